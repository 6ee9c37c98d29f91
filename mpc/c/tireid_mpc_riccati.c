/* Riccati recursion: backward to feedback and gradients, forward to states and rows.
 *
 * The cost from stage k on is 1/2 dx'M dx + m'dx; its minimum over du is at K dx + d. A held stage has
 * K and d of its bound instead: du itself, or the du that brings the angle to its limit.
 * Where the car is on the path does not act on its motion: A is block triangular, its first NE
 * columns have but NE rows. */
#include "tireid_mpc_riccati.h"

#include "tireid_mpc_equations.h"

#define N TIREID_MPC_HORIZON
#define NX TIREID_MPC_STATES
#define NE 2U /* errors against the path, the first states */
#define ROWS TIREID_MPC_ROWS
#define STEERING 4U /* place of the angle among the states */
#define real tireid_mpc_real

/* H + W and h + slope of the rows of the states of stage k + 1; upper triangle by columns. */
static void add_rows(const tireid_mpc_work *work, uint32_t k, real *restrict H)
{
    const tireid_mpc_stage *stage = &work->stage[k + 1U];
    const uint32_t p = k * ROWS;
    const real *scale = &work->scale[p];
    uint32_t i;
    uint32_t j;
    real W[ROWS];
    for (i = 0U; i < ROWS; i++) {
        W[i] = work->weight[0][p + i] + work->weight[1][p + i];
    }
    H[0] += W[2] * scale[2] * scale[2];
    H[STEERING + (NX * STEERING)] += W[1] * scale[1] * scale[1];
    for (i = 0U; i < 2U; i++) {
        const real *a = stage->slip_x;
        const real w = W[3U + i] * scale[3U + i] * scale[3U + i];
        for (j = NE; j <= STEERING; j++) {
            uint32_t n;
            const real wa = w * a[i + (2U * j)];
            for (n = NE; n <= j; n++) {
                H[n + (NX * j)] += wa * a[i + (2U * n)];
            }
        }
    }
}

static void add_slopes(const tireid_mpc_work *work, uint32_t k, real *restrict h)
{
    const tireid_mpc_stage *stage = &work->stage[k + 1U];
    const real *g = &work->slope[k * ROWS];
    const real *scale = &work->scale[k * ROWS];
    uint32_t j;
    h[0] += g[2] * scale[2];
    h[STEERING] += g[1] * scale[1];
    for (j = NE; j <= STEERING; j++) {
        h[j] += (g[3] * scale[3] * stage->slip_x[2U * j])
            + (g[4] * scale[4] * stage->slip_x[1U + (2U * j)]);
    }
}

/* Rows of column j of A that are not zero. */
static uint32_t rows_of(uint32_t j)
{
    return (j < NE) ? NE : NX;
}

/* P of the cost behind stage k, both triangles, from that of stage k + 1 and its rows. */
static void take_behind(const tireid_mpc_work *work, uint32_t k, real *restrict P)
{
    const real *restrict M = work->M[k + 1U];
    uint32_t i;
    uint32_t j;
    for (j = 0U; j < NX; j++) {
        for (i = 0U; i <= j; i++) {
            P[i + (NX * j)] = M[i + (NX * j)];
        }
    }
    add_rows(work, k, P);
    for (j = 0U; j < NX; j++) {
        for (i = 0U; i < j; i++) {
            P[j + (NX * i)] = P[i + (NX * j)];
        }
    }
}

/* What stage k has of the cost P behind it: P c, P B and B'P B + R. False where not convex. */
static bool look_behind(
    tireid_mpc_work *work, uint32_t k, real R, const real *restrict P, real *restrict PB)
{
    const tireid_mpc_stage *stage = &work->stage[k];
    const real weight = work->weight[0][k * ROWS] + work->weight[1][k * ROWS];
    const real scale = work->scale[k * ROWS];
    real lambda = R + (weight * scale * scale);
    uint32_t i;
    uint32_t j;
    for (i = 0U; i < NX; i++) {
        real pb = TIREID_MPC_C(0.0);
        real pc = TIREID_MPC_C(0.0);
        for (j = 0U; j < NX; j++) {
            pb += P[j + (NX * i)] * stage->B[j];
            pc += P[j + (NX * i)] * stage->c[j];
        }
        PB[i] = pb;
        work->Pc[k][i] = pc;
        lambda += stage->B[i] * pb;
    }
    work->lambda[k] = lambda;
    work->per_lambda[k] =
        (lambda > TIREID_MPC_C(0.0)) ? (TIREID_MPC_C(1.0) / lambda) : TIREID_MPC_C(0.0);
    return lambda > TIREID_MPC_C(0.0);
}

/* Feedback K of stage k where it is held. */
static void hold(tireid_mpc_work *work, uint32_t k)
{
    const tireid_mpc_stage *stage = &work->stage[k];
    uint32_t j;
    for (j = 0U; j < NX; j++) {
        work->feedback[k][j] = (work->held[k] == TIREID_MPC_ANGLE)
            ? (-stage->A[STEERING + (NX * j)] / stage->B[STEERING])
            : TIREID_MPC_C(0.0);
    }
}

/* Feedback K of stage k, and M = H + A'P A + K'L, its upper triangle, with L = B'P A = -lambda K; held
 * to an angle it has L'K + lambda K'K besides. */
static void feed_back(
    tireid_mpc_work *work, uint32_t k, const real *restrict P, const real *restrict PB)
{
    const tireid_mpc_stage *stage = &work->stage[k];
    const real *restrict A = stage->A;
    real *restrict K = work->feedback[k];
    real *restrict L = work->L[k];
    real *restrict M = work->M[k];
    real S[NX * NX]; /* P A */
    uint32_t i;
    uint32_t j;
    uint32_t n;
    for (j = 0U; j < NX; j++) {
        real l = TIREID_MPC_C(0.0);
        for (n = 0U; n < rows_of(j); n++) {
            l += A[n + (NX * j)] * PB[n];
        }
        L[j] = l;
        K[j] = -(l * work->per_lambda[k]);
        for (i = 0U; i < NX; i++) {
            real s = TIREID_MPC_C(0.0);
            for (n = 0U; n < rows_of(j); n++) {
                s += P[i + (NX * n)] * A[n + (NX * j)];
            }
            S[i + (NX * j)] = s;
        }
    }
    if (work->held[k] != TIREID_MPC_FREE) {
        hold(work, k);
    }
    for (j = 0U; j < NX; j++) {
        for (i = 0U; i <= j; i++) {
            real m = stage->H[i + (NX * j)] + (K[i] * L[j]);
            for (n = 0U; n < rows_of(i); n++) {
                m += A[n + (NX * i)] * S[n + (NX * j)];
            }
            M[i + (NX * j)] = m;
        }
    }
    if (work->held[k] == TIREID_MPC_ANGLE) {
        for (j = 0U; j < NX; j++) {
            for (i = 0U; i <= j; i++) {
                M[i + (NX * j)] += (L[i] + (work->lambda[k] * K[i])) * K[j];
            }
        }
    }
}

bool tireid_mpc_factorize(tireid_mpc_work *work, real R, uint32_t last)
{
    real P[NX * NX]; /* of the cost behind a stage */
    real PB[NX];
    bool convex = true;
    uint32_t i;
    uint32_t k;
    for (i = 0U; i < (NX * NX); i++) {
        work->M[N][i] = work->stage[N].H[i];
    }
    for (k = last + 1U; k-- > 0U;) {
        take_behind(work, k, P);
        convex = look_behind(work, k, R, P, PB) && convex;
        feed_back(work, k, P, PB); /* of stage 0 for the next plan: here x[0] is zero */
    }
    return convex;
}

/* du of stage k where the state is the plan's: its best, or that of its bound. */
static real alone(const tireid_mpc_work *work, uint32_t k)
{
    const tireid_mpc_stage *stage = &work->stage[k];
    real du = -(work->l[k] * work->per_lambda[k]);
    if (work->held[k] == TIREID_MPC_RATE) {
        du = work->held_to[k];
    } else if (work->held[k] == TIREID_MPC_ANGLE) {
        du = (work->held_to[k] - stage->c[STEERING]) / stage->B[STEERING];
    } else {
        /* free */
    }
    return du;
}

/* s = m + P c of the gradient m behind stage k, and what of that of the input is not of du. */
static void feed_forward(
    tireid_mpc_work *work, uint32_t k, real R, const real *restrict m, real *restrict s)
{
    const tireid_mpc_stage *stage = &work->stage[k];
    real l = (R * work->u[k]) + (work->slope[k * ROWS] * work->scale[k * ROWS]);
    uint32_t i;
    for (i = 0U; i < NX; i++) {
        s[i] = m[i] + work->Pc[k][i];
        l += stage->B[i] * s[i];
    }
    work->l[k] = l;
}

/* Gradient m of the cost from stage k on, for s of what is behind it. */
static void look_back(tireid_mpc_work *work, uint32_t k, const real *restrict s, real *restrict m)
{
    const tireid_mpc_stage *stage = &work->stage[k];
    const bool held = work->held[k] != TIREID_MPC_FREE;
    const real d = work->d[k];
    const real l = held ? (work->l[k] + (work->lambda[k] * d)) : work->l[k];
    uint32_t i;
    uint32_t j;
    for (j = 0U; j < NX; j++) {
        real g = stage->h[j] + (work->feedback[k][j] * l);
        for (i = 0U; i < rows_of(j); i++) {
            g += stage->A[i + (NX * j)] * s[i];
        }
        m[j] = g;
    }
    if (held) {
        for (j = 0U; j < NX; j++) {
            m[j] += work->L[k][j] * d;
        }
    }
}

void tireid_mpc_backward(tireid_mpc_work *work, real R, uint32_t last)
{
    real m[NX];
    real s[NX];
    uint32_t i;
    uint32_t k;
    for (i = 0U; i < NX; i++) {
        m[i] = (last == (N - 1U)) ? work->stage[N].h[i] : work->m[last + 1U][i];
        work->m[last + 1U][i] = m[i];
    }
    for (k = last + 1U; k-- > 0U;) {
        add_slopes(work, k, m);
        feed_forward(work, k, R, m, s);
        work->d[k] = alone(work, k);
        look_back(work, k, s, m);
        for (i = 0U; i < NX; i++) {
            work->m[k][i] = m[i];
        }
    }
}

/* Values of the rows of stage k for what was found. */
static void reach(tireid_mpc_work *work, uint32_t k, real du, const real *restrict dx)
{
    const tireid_mpc_stage *next = &work->stage[k + 1U];
    const real *scale = &work->scale[k * ROWS];
    const real *value = &work->value[k * ROWS];
    real *reached = &work->reached[k * ROWS];
    real front = TIREID_MPC_C(0.0);
    real rear = TIREID_MPC_C(0.0);
    uint32_t j;
    for (j = NE; j <= STEERING; j++) {
        front += next->slip_x[2U * j] * dx[j];
        rear += next->slip_x[1U + (2U * j)] * dx[j];
    }
    reached[0] = value[0] + (scale[0] * du);
    reached[1] = value[1] + (scale[1] * dx[STEERING]);
    reached[2] = value[2] + (scale[2] * dx[0]);
    reached[3] = value[3] + (scale[3] * front);
    reached[4] = value[4] + (scale[4] * rear);
}

void tireid_mpc_forward(tireid_mpc_work *work)
{
    real now[NX];
    uint32_t i;
    uint32_t j;
    uint32_t k;
    for (i = 0U; i < NX; i++) {
        now[i] = work->dx[0][i];
    }
    for (k = 0U; k < N; k++) {
        const tireid_mpc_stage *stage = &work->stage[k];
        real du = work->d[k];
        real dx[NX];
        for (j = 0U; j < NX; j++) {
            du += work->feedback[k][j] * now[j];
        }
        for (i = 0U; i < NX; i++) {
            dx[i] = stage->c[i] + (stage->B[i] * du);
        }
        for (j = 0U; j < NX; j++) {
            for (i = 0U; i < rows_of(j); i++) {
                dx[i] += stage->A[i + (NX * j)] * now[j];
            }
        }
        reach(work, k, du, dx);
        work->du[k] = du;
        for (i = 0U; i < NX; i++) {
            now[i] = dx[i];
            work->dx[k + 1U][i] = dx[i];
        }
    }
}

real tireid_mpc_pull(const tireid_mpc_work *work, uint32_t k)
{
    real pull = work->l[k] + (work->lambda[k] * work->du[k]);
    uint32_t j;
    for (j = 0U; j < NX; j++) {
        pull += work->L[k][j] * work->dx[k][j];
    }
    return pull;
}
