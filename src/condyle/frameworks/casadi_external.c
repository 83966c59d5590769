/* A kernel's batch as an external function of CasADi, NAME, and another as its Jacobian, jac_NAME.
 * What they are is told to `bind` once the library is loaded. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#define WIDTH 4096
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)

typedef void Batch(const double *table, const double *const *in, const ptrdiff_t *stride,
                   size_t count, double *out, size_t columns, uint8_t *status);
typedef struct {
    Batch *batch;
    const double *table;
    int64_t columns; /* of the kernel: where each input is, */
    const int64_t *argument, *entry;
    int64_t width; /* and where each result goes */
    const int64_t *result, *place;
    int64_t inputs, outputs; /* of the function: rows, columns, 1 of each */
    const long long *shapes_in, *shapes_out;
    const char *const *names_in, *const *names_out;
} Kernel;

static Kernel kernels[2];

void bind(int which, const Kernel *kernel) { kernels[which] = *kernel; }

static int call(const Kernel *k, const double **arg, double **res) {
    static const double zero = 0.0;
    static const ptrdiff_t stride[WIDTH];
    const double *in[WIDTH];
    double out[WIDTH];
    uint8_t status;
    if (k->columns > WIDTH || k->width > WIDTH) return 1;
    for (int64_t i = 0; i < k->columns; i++) {
        const double *own = arg[k->argument[i]];
        in[i] = own ? own + k->entry[i] : &zero;
    }
    k->batch(k->table, in, stride, 1, out, 1, &status);
    for (int64_t i = 0; i < k->width; i++) {
        double *own = k->result[i] < 0 ? NULL : res[k->result[i]];
        if (own) own[k->place[i]] = status ? (double)NAN : out[i];
    }
    return 0;
}

#define FUNCTION(name, k)                                                                        \
    int name(const double **arg, double **res, long long *iw, double *w, int mem) {              \
        (void)iw, (void)w, (void)mem;                                                            \
        return call(k, arg, res);                                                                \
    }                                                                                            \
    long long JOIN(name, _n_in)(void) { return (k)->inputs; }                                    \
    long long JOIN(name, _n_out)(void) { return (k)->outputs; }                                  \
    const char *JOIN(name, _name_in)(long long i) { return (k)->names_in[i]; }                   \
    const char *JOIN(name, _name_out)(long long i) { return (k)->names_out[i]; }                 \
    const long long *JOIN(name, _sparsity_in)(long long i) { return (k)->shapes_in + 3 * i; }    \
    const long long *JOIN(name, _sparsity_out)(long long i) { return (k)->shapes_out + 3 * i; }  \
    int JOIN(name, _work)(long long *arg, long long *res, long long *iw, long long *w) {         \
        *arg = (k)->inputs, *res = (k)->outputs, *iw = 0, *w = 0;                                \
        return 0;                                                                                \
    }

FUNCTION(NAME, &kernels[0])
FUNCTION(JOIN(jac_, NAME), &kernels[1])
