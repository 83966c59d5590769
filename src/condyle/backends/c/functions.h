static real sqrt_s(real a) { return F(sqrt)(a); }
static real rsqrt_s(real a) { return R(1.0) / F(sqrt)(a); }
static real fabs_s(real a) { return F(fabs)(a); }
static real fmin_s(real a, real b) { return a < b ? a : b; }
static real fmax_s(real a, real b) { return a > b ? a : b; }
static real le_s(real a, real b) { return a <= b ? R(1.0) : R(0.0); }
static real lt_s(real a, real b) { return a < b ? R(1.0) : R(0.0); }
static real eq_s(real a, real b) { return a >= b && a <= b ? R(1.0) : R(0.0); }
static real ne_s(real a, real b) { return a >= b && a <= b ? R(0.0) : R(1.0); }
static real not_s(real a) { return a >= R(0.0) && a <= R(0.0) ? R(1.0) : R(0.0); }
static real and_s(real a, real b) { return not_s(a) + not_s(b) > R(0.0) ? R(0.0) : R(1.0); }
static real or_s(real a, real b) { return not_s(a) + not_s(b) > R(1.5) ? R(0.0) : R(1.0); }
static real where_s(real a, real b) { return not_s(a) > R(0.0) ? R(0.0) : b; }
static real sign_s(real a) { return a < R(0.0) ? R(-1.0) : a > R(0.0) ? R(1.0) : a; }
static real copysign_s(real a, real b) { return F(copysign)(a, b); }
static real pow_s(real a, real b) { return F(pow)(a, b); }
static real fmod_s(real a, real b) { return F(fmod)(a, b); }
static real remainder_s(real a, real b) { return F(remainder)(a, b); }
static real hypot_s(real a, real b) { return F(hypot)(a, b); }
static real floor_s(real a) { return F(floor)(a); }
static real ceil_s(real a) { return F(ceil)(a); }
static real exp_s(real a) { return F(exp)(a); }
static real expm1_s(real a) { return F(expm1)(a); }
static real log_s(real a) { return F(log)(a); }
static real log1p_s(real a) { return F(log1p)(a); }
static real tan_s(real a) { return F(tan)(a); }
static real asin_s(real a) { return F(asin)(a); }
static real acos_s(real a) { return F(acos)(a); }
static real atan_s(real a) { return F(atan)(a); }
static real sinh_s(real a) { return F(sinh)(a); }
static real cosh_s(real a) { return F(cosh)(a); }
static real tanh_s(real a) { return F(tanh)(a); }
static real asinh_s(real a) { return F(asinh)(a); }
static real acosh_s(real a) { return F(acosh)(a); }
static real atanh_s(real a) { return F(atanh)(a); }
static real erf_s(real a) { return F(erf)(a); }
