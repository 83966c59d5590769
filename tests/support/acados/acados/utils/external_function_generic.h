/* What exported files use of acados, declared anew: arguments with their offsets. */
#ifndef EXTERNAL_FUNCTION_GENERIC_H
#define EXTERNAL_FUNCTION_GENERIC_H
#include "blasfeo_common.h"
struct blasfeo_dvec_args { struct blasfeo_dvec *x; int xi; };
struct blasfeo_dmat_args { struct blasfeo_dmat *A; int ai, aj; };
#endif
