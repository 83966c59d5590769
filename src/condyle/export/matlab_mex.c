#include "mex.h"

/* Columns are samples; a single column serves all. */
void mexFunction(int nlhs, mxArray *plhs[], int nrhs, const mxArray *prhs[])
{
    const double *given[INPUTS];
    size_t step[INPUTS], samples = 1;
    double *found[OUTPUTS], *status;
    if (nrhs != INPUTS)
        mexErrMsgIdAndTxt("condyle:arguments", NAME ": expected %d arguments, got %d", INPUTS, nrhs);
    if (nlhs > OUTPUTS + 1)
        mexErrMsgIdAndTxt("condyle:arguments", NAME ": there are %d outputs", OUTPUTS + 1);
    for (int i = 0; i < INPUTS; i++) {
        const size_t columns = mxGetN(prhs[i]);
        if (!mxIsDouble(prhs[i]) || mxIsComplex(prhs[i]) || mxIsSparse(prhs[i]) ||
            mxGetNumberOfDimensions(prhs[i]) != 2 || mxGetM(prhs[i]) != ARGUMENTS[i].size)
            mexErrMsgIdAndTxt("condyle:arguments", NAME ": %s: expected a real matrix of %u rows",
                              ARGUMENTS[i].name, ARGUMENTS[i].size);
        if (columns != 1) {
            if (samples != 1 && columns != samples)
                mexErrMsgIdAndTxt("condyle:arguments", NAME ": %s: %u columns, others have %u",
                                  ARGUMENTS[i].name, (unsigned)columns, (unsigned)samples);
            samples = columns;
        }
        given[i] = mxGetPr(prhs[i]);
        step[i] = columns == 1 ? 0 : ARGUMENTS[i].size;
    }
    {
        mxArray *made[OUTPUTS + 1];
        for (int k = 0; k < OUTPUTS; k++) {
            made[k] = mxCreateDoubleMatrix(ARGUMENTS[INPUTS + k].size, samples, mxREAL);
            found[k] = mxGetPr(made[k]);
        }
        made[OUTPUTS] = mxCreateDoubleMatrix(1, samples, mxREAL);
        status = mxGetPr(made[OUTPUTS]);
        for (size_t n = 0; n < samples; n++) {
            const double *in[INPUTS];
            double *out[OUTPUTS];
            for (int i = 0; i < INPUTS; i++)
                in[i] = given[i] + n * step[i];
            for (int k = 0; k < OUTPUTS; k++)
                out[k] = found[k] + n * ARGUMENTS[INPUTS + k].size;
            status[n] = CALL(in, out);
            if (status[n] == 0)
                continue;
            if (nlhs <= OUTPUTS)
                mexErrMsgIdAndTxt("condyle:status", NAME ": sample %u has status %d (see help)",
                                  (unsigned)n + 1, (int)status[n]);
            for (int k = 0; k < OUTPUTS; k++)
                for (unsigned j = 0; j < ARGUMENTS[INPUTS + k].size; j++)
                    out[k][j] = mxGetNaN();
        }
        for (int k = 0; k <= OUTPUTS; k++) {
            if (k < nlhs || k == 0)
                plhs[k] = made[k];
            else
                mxDestroyArray(made[k]);
        }
    }
}
