/* XLA's call of a kernel's batch. Arguments are arrays (..., size), results too, without a number
 * where the status is not 0; statuses (...) come last.
 *
 * Attributes: address: of `batch` and its table;  argument, entry: where each input column is;
 *             result, place: where each column of the kernel goes. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "xla/ffi/api/c_api.h"

#define SAMPLES 256 /* of a piece, whose columns stay in a cache */
#define COLUMNS 8192

typedef void Batch(const double *table, const double *const *in, const ptrdiff_t *stride,
                   size_t count, double *out, size_t columns, uint8_t *status);

static const void *attribute(const XLA_FFI_CallFrame *call, const char *name, size_t *size) {
    for (int64_t i = 0; i < call->attrs.size; i++) {
        const XLA_FFI_ByteSpan *own = call->attrs.names[i];
        if (own->len != strlen(name) || memcmp(own->ptr, name, own->len)) continue;
        const XLA_FFI_Array *array = call->attrs.attrs[i];
        *size = array->size;
        return array->data;
    }
    *size = 0;
    return NULL;
}

static XLA_FFI_Error *refused(const XLA_FFI_CallFrame *call, const char *message) {
    XLA_FFI_Error_Create_Args args = {XLA_FFI_Error_Create_Args_STRUCT_SIZE, NULL, message,
                                      XLA_FFI_Error_Code_INVALID_ARGUMENT};
    return call->api->XLA_FFI_Error_Create(&args);
}

XLA_FFI_Error *condyle_batch(XLA_FFI_CallFrame *call) {
    for (XLA_FFI_Extension_Base *e = call->extension_start; e; e = e->next)
        if (e->type == XLA_FFI_Extension_Metadata) {
            XLA_FFI_Metadata *about = ((XLA_FFI_Metadata_Extension *)e)->metadata;
            about->api_version.major_version = XLA_FFI_API_MAJOR;
            about->api_version.minor_version = XLA_FFI_API_MINOR;
            return NULL;
        }
    size_t two, columns, same, width, alike;
    const int64_t *address = attribute(call, "address", &two);
    const int64_t *argument = attribute(call, "argument", &columns);
    const int64_t *entry = attribute(call, "entry", &same);
    const int64_t *result = attribute(call, "result", &width);
    const int64_t *place = attribute(call, "place", &alike);
    const int64_t results = call->rets.size - 1;
    if (two != 2 || same != columns || columns > COLUMNS || alike != width || results < 1)
        return refused(call, "condyle: attributes do not fit");
    const XLA_FFI_Buffer *statuses = call->rets.rets[results];
    size_t count = 1;
    for (int64_t d = 0; d < statuses->rank; d++) count *= (size_t)statuses->dims[d];
    const double *in[COLUMNS];
    ptrdiff_t stride[COLUMNS];
    for (size_t k = 0; k < columns; k++) {
        const XLA_FFI_Buffer *own = call->args.args[argument[k]];
        if (own->dtype != XLA_FFI_DataType_F64) return refused(call, "condyle: expected float64");
        in[k] = (const double *)own->data + entry[k];
        stride[k] = own->dims[own->rank - 1];
    }
    Batch *batch = (Batch *)(uintptr_t)address[0];
    const double *table = (const double *)(uintptr_t)address[1];
    double *found = malloc(sizeof(double) * (width + 1) * SAMPLES);
    if (!found) return refused(call, "condyle: no memory");
    for (size_t start = 0; start < count; start += SAMPLES) {
        size_t some = count - start < SAMPLES ? count - start : SAMPLES;
        uint8_t *status = (uint8_t *)statuses->data + start;
        batch(table, in, stride, some, found, SAMPLES, status);
        for (size_t k = 0; k < width; k++) {
            const XLA_FFI_Buffer *own = call->rets.rets[result[k]];
            const size_t size = (size_t)own->dims[own->rank - 1];
            double *to = (double *)own->data + start * size + (size_t)place[k];
            for (size_t i = 0; i < some; i++) to[i * size] = found[k * SAMPLES + i];
        }
        for (size_t i = 0; i < some; i++)
            for (int64_t r = 0; status[i] && r < results; r++) {
                const XLA_FFI_Buffer *own = call->rets.rets[r];
                const size_t size = (size_t)own->dims[own->rank - 1];
                double *to = (double *)own->data + (start + i) * size;
                for (size_t k = 0; k < size; k++) to[k] = (double)NAN;
            }
        for (size_t i = 0; i < some; i++)
            if (status[i] == AGAIN) status[i] = UNCERTIFIED;
        for (size_t k = 0; k < columns; k++) in[k] += stride[k] * SAMPLES;
    }
    free(found);
    return NULL;
}
