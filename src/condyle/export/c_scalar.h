/* Sine and cosine: quarter turns off in three parts, then polynomials (Cephes). No branch, so that
 * every angle takes the same time, for which two values are volatile too; no number where the angle
 * is beyond ANGLES. */
static void sincos_s(real x, real *sine, real *cosine) {
    const int far = !(F(fabs)(x) < ANGLES);
    const volatile real angle = far ? R(0.0) : x, lost = far ? (real)NAN : R(0.0);
    const real a0 = angle, missing = lost;
    const long turns = (long)(a0 * R(0.63661977236758138243) + (a0 < R(0.0) ? R(-0.5) : R(0.5)));
    const real n = (real)turns;
    const real r = ((a0 - n * QUARTER_1) - n * QUARTER_2) - n * QUARTER_3;
    const real z = r * r;
    const real s = r + r * z * sine_terms(z) + missing;
    const real c = R(1.0) - R(0.5) * z + z * z * cosine_terms(z) + missing;
    const real a = (turns & 1) ? c : s;
    const real b = (turns & 1) ? s : c;
    *sine = (turns & 2) ? -a : a;
    *cosine = ((turns + 1) & 2) ? -b : b;
}

/* Arc of a point: t = lesser over greater coordinate, or (t - 1) / (t + 1) where that is smaller, so
 * that |t| <= 1/2; what is left is a number of eighths of a turn. No branch. */
static real atan2_s(real y, real x) {
    const real across = F(fabs)(y), along = F(fabs)(x);
    const int steep = across > along, back = x < R(0.0);
    const real most = steep ? across : along, least = steep ? along : across;
    const int wide = least > R(0.5) * most;
    const real over = wide ? least - most : least, under = wide ? least + most : most;
    const real t = over / (under > R(0.0) ? under : R(1.0));
    const real z = t * t;
    const real part = t + t * z * arc_terms(z);
    const real first = wide ? R(1.0) : R(0.0);
    const real second = steep ? R(2.0) - first : first;
    const real eighths = back ? R(4.0) - second : second;
    const real rest = steep != back ? -part : part;
    const real arc = eighths * ARC_STEP + (rest + eighths * ARC_STEP_REST) + (y - y);
    return y < R(0.0) ? -arc : arc;
}

static real sizes_s(const real *x, int count) {
    real sum = R(0.0);
    for (int i = 0; i < count; i++) sum += F(fabs)(x[i]);
    return sum;
}
