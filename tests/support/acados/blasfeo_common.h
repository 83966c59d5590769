/* What exported files use of blasfeo, declared anew: vectors, and matrices column by column. */
#ifndef BLASFEO_COMMON_H
#define BLASFEO_COMMON_H
struct blasfeo_dvec { double *pa; int m; };
struct blasfeo_dmat { double *pA; int m, n; };
#define BLASFEO_DVECEL(x, i) ((x)->pa[i])
#define BLASFEO_DMATEL(A, i, j) ((A)->pA[(i) + (j) * (A)->m])
#endif
