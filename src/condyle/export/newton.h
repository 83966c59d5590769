/* Least squares by Householder's reflections: x with A x ~ b for every column of b.
 *
 * a: (rows, columns), overwritten by its triangle;  b: (rows, right), overwritten, x first.
 * Returns the least diagonal entry of the triangle over the greatest. */
static real least_squares(real *a, int rows, int columns, real *b, int right)
{
    real least = R(0.0), most = R(0.0);
    for (int k = 0; k < columns; k++) {
        real square = R(0.0);
        for (int i = k; i < rows; i++) square += a[i * columns + k] * a[i * columns + k];
        const real length = a[k * columns + k] > R(0.0) ? -F(sqrt)(square) : F(sqrt)(square);
        const real head = a[k * columns + k] - length;
        const real size = F(fabs)(length);
        const real scale = length * head < R(0.0) ? R(1.0) / (length * head) : R(0.0);
        for (int j = k + 1; j < columns + right; j++) {
            real *const other = j < columns ? a + j : b + (j - columns);
            const int stride = j < columns ? columns : right;
            real dot = head * other[k * stride];
            for (int i = k + 1; i < rows; i++) dot += a[i * columns + k] * other[i * stride];
            dot *= scale;
            other[k * stride] += dot * head;
            for (int i = k + 1; i < rows; i++) other[i * stride] += dot * a[i * columns + k];
        }
        a[k * columns + k] = length;
        least = k == 0 || size < least ? size : least;
        most = size > most ? size : most;
    }
    for (int j = 0; j < right; j++)
        for (int k = columns - 1; k >= 0; k--) {
            real rest = b[k * right + j];
            for (int i = k + 1; i < columns; i++) rest -= a[k * columns + i] * b[i * right + j];
            b[k * right + j] = F(fabs)(a[k * columns + k]) > R(0.0) ? rest / a[k * columns + k] : R(0.0);
        }
    return most > R(0.0) ? least / most : R(0.0);
}

/* One Gauss-Newton step: of the pose, its largest entry in characteristic lengths and radians, what
 * is left of the joints, its square with the distance from the surfaces, and A; whether the step
 * changes joints by no more than rounding, and how far A is from losing rank. */
typedef struct {
    real move[6], residual[N], A[N * M], size, error, regular;
    int settled, finite;
} newton_step;

/* X <- X + M_J dq + dX_phi, with A dq ~ theta - theta(X) - J_theta dX_phi and A = J_theta M_J. */
static void step_at(CONTEXT const real *at, const real *joint, newton_step *s)
{
    static const real weight[N] = WEIGHT, unit[6] = UNIT, turn[N] = TURNING;
    static const int column[M] = FREE;
    real found[N], J_theta[6 * N], M_J[6 * M], correction[6], phi[K], triangle[N * M], b[N];
    real total = R(0.0), off = R(0.0), noise = R(1.0), change = R(0.0);
    encoders(ARGUMENTS at, found, J_theta, M_J, correction, phi);
    s->size = s->error = R(0.0);
    for (int i = 0; i < N; i++) {
        real left = joint[i] - found[i];
        left -= turn[i] * (real)(long)(left * TURN + (left < R(0.0) ? R(-0.5) : R(0.5)));
        s->residual[i] = left;
        s->error += left * weight[i] * LENGTH * (left * weight[i] * LENGTH);
        for (int r = 0; r < 6; r++) left -= J_theta[r * N + i] * correction[r];
        b[i] = left * weight[i];
        for (int k = 0; k < M; k++) {
            real sum = R(0.0);
            for (int r = 0; r < 6; r++) sum += J_theta[r * N + i] * M_J[r * M + k];
            s->A[i * M + k] = triangle[i * M + k] = sum * weight[i] * unit[column[k]];
        }
    }
    for (int i = 0; i < CONTACTS; i++) off += F(fabs)(phi[i]), s->error += phi[i] * phi[i];
    s->regular = least_squares(triangle, N, M, b, 1);
    for (int r = 0; r < 6; r++) {
        real own = correction[r], size;
        for (int k = 0; k < M; k++) own += M_J[r * M + k] * b[k] * unit[column[k]];
        size = F(fabs)(own) / unit[r];
        s->move[r] = own;
        s->size = size > s->size ? size : s->size;
        total += size;
    }
    for (int i = 0; i < N; i++) {
        real own = R(0.0), rounding = R(1.0);
        for (int k = 0; k < M; k++) {
            own += s->A[i * M + k] * b[k];
            rounding += F(fabs)(s->A[i * M + k]);
        }
        change = F(fabs)(own) > change ? F(fabs)(own) : change;
        noise = rounding > noise ? rounding : noise;
    }
    s->finite = total <= R(1e9) && s->error <= R(1e9);
    s->settled = change <= ROUNDING * noise && off <= ROUNDING * LENGTH;
}

/* |1 - A_end^+ A_start|^2. */
static real unlikeness(const newton_step *start, const newton_step *end)
{
    real triangle[N * M], x[N * M], square = R(0.0);
    for (int i = 0; i < N * M; i++) triangle[i] = end->A[i], x[i] = start->A[i];
    least_squares(triangle, N, M, x, M);
    for (int i = 0; i < M; i++)
        for (int k = 0; k < M; k++) {
            const real one = x[i * M + k] - (i == k ? R(1.0) : R(0.0));
            square += one * one;
        }
    return square;
}

/* The pose is followed from the start in pieces of steps. A piece is taken if it is a whole step
 * and the next is at most a quarter as long, or if it is short and comes nearer; and if its ends
 * invert each other, so that no singularity is leapt over. Others are halved. */
static int followed(CONTEXT const real *joint, const real *start, real *pose, real *residual)
{
    newton_step steps[2], *here = &steps[0], *next = &steps[1], *last;
    real piece = R(1.0);
    int reached = 0, going = 1;
    for (int r = 0; r < 6; r++) pose[r] = start[r];
    step_at(ARGUMENTS pose, joint, here);
    going = here->finite;
    for (int i = 1; i < ITERATIONS && going; i++) {
        const real whole = here->size > R(1.0) ? R(1.0) / here->size : R(1.0);
        const real part = piece < whole ? piece : whole;
        real x[6];
        int nearer, taken;
        for (int r = 0; r < 6; r++) x[r] = pose[r] + part * here->move[r];
        step_at(ARGUMENTS x, joint, next);
        nearer = part < R(1.0) && part * here->size <= R(0.25) && next->error < here->error;
        taken = next->finite && (next->size <= R(0.25) * here->size || nearer);
        taken = taken && unlikeness(here, next) <= R(0.25);
        reached = here->size <= CONVERGED || (here->settled && !taken);
        if (taken) {
            for (int r = 0; r < 6; r++) pose[r] = x[r];
            last = here, here = next, next = last;
        }
        piece = taken ? R(2.0) * part : R(0.5) * part;
        going = !reached && piece >= R(0.0009765625);
    }
    for (int i = 0; i < N; i++) residual[i] = here->residual[i];
    if (here->finite && !(here->regular >= REGULAR)) return P_SINGULAR;
    return reached ? P_OK : P_UNREACHABLE;
}
