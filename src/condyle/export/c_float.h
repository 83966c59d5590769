typedef float real;
#define F(name) name##f
#define R(number) number##f
#define ANGLES 4096.0f
#define QUARTER_1 1.5703125f
#define QUARTER_2 4.837512969970703125e-4f
#define QUARTER_3 7.5497899548918821e-8f
static real sine_terms(real z) {
    return -1.6666654611e-1f + z * (8.3321608736e-3f - z * 1.9515295891e-4f);
}
static real cosine_terms(real z) {
    return 4.166664568298827e-2f + z * (-1.388731625493765e-3f + z * 2.443315711809948e-5f);
}
#define ARC_STEP 0.78539819f
#define ARC_STEP_REST (-2.1855695e-8f)
static real arc_terms(real z) {
    return -3.3333332922e-1f + z * (1.9999879226e-1f + z * (-1.4279926842e-1f + z *
    (1.1008277191e-1f + z * (-8.2418495650e-2f + z * 4.2357863526e-2f))));
}
