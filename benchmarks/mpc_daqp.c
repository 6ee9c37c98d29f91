/* The tracker's quadratic program condensed to the inputs and handed to DAQP, which ships in the
 * CasADi wheel: the road not taken, to measure what it would save. Follows the tracker in one file.
 *
 * dx[k] = G[k] du + d[k]; the sums run over all inputs before stage k at once. Deviation is soft by
 * DAQP's own rule, one weight for all rows after it has scaled them. */
#include <daqp/api.h>
#include <daqp/utils.h>

#undef NX
#define N MPC_HORIZON
#define NX MPC_STATES
#define M (3U * N) /* rows: u, steering, deviation */

static struct {
    double G[N + 1U][NX][N], W[NX][N], d[N + 1U][NX];
    double H[N * N], f[N], A[2U * N * N], upper[M], lower[M], x[N], lambda[M];
    int sense[M];
} c;
static union { DAQPWorkspace it; char space[sizeof(DAQPWorkspace) + 256]; } daqp;
static int is_set_up = 0;

static void condense(const mpc_work *work, const mpc_params *params)
{
    uint32_t k, i, j, n;
    memset(c.d[0], 0, sizeof c.d[0]);
    for (k = 0U; k < N; k++) { /* forward: columns of the inputs 0 ... k */
        const mpc_stage *s = &work->stage[k];
        for (i = 0U; i < NX; i++) {
            double d = s->c[i];
            for (j = 0U; j < k; j++) c.G[k + 1U][i][j] = 0.0;
            for (n = 0U; n < NX; n++) {
                const double a = s->A[i + (NX * n)];
                d += a * c.d[k][n];
                if (a != 0.0)
                    for (j = 0U; j < k; j++) c.G[k + 1U][i][j] += a * c.G[k][n][j];
            }
            c.G[k + 1U][i][k] = s->B[i];
            c.d[k + 1U][i] = d;
        }
    }
    {
        double p[NX] = { 0.0 }; /* gradient behind stage k */
        memset(c.W, 0, sizeof c.W);
        for (k = N; k-- > 0U;) {
            const mpc_stage *s = &work->stage[k], *next = &work->stage[k + 1U];
            double V[NX][N], q[NX];
            for (i = 0U; i < NX; i++) { /* H G + A'W of the stage behind, and the same of h */
                double g = next->h[i];
                for (j = 0U; j <= k; j++) V[i][j] = 0.0;
                for (n = 0U; n < NX; n++) {
                    const double h = next->H[i + (NX * n)];
                    g += h * c.d[k + 1U][n];
                    if (h != 0.0)
                        for (j = 0U; j <= k; j++) V[i][j] += h * c.G[k + 1U][n][j];
                }
                if (k + 1U < N) {
                    for (n = 0U; n < NX; n++) {
                        const double a = next->A[n + (NX * i)];
                        g += a * p[n];
                        if (a != 0.0)
                            for (j = 0U; j <= k; j++) V[i][j] += a * c.W[n][j];
                    }
                }
                q[i] = g;
            }
            memcpy(c.W, V, sizeof V);
            memcpy(p, q, sizeof q);
            c.f[k] = params->cost_rate * work->u[k];
            for (j = 0U; j <= k; j++) {
                double h = (j == k) ? params->cost_rate : 0.0;
                for (n = 0U; n < NX; n++) h += s->B[n] * c.W[n][j];
                c.H[(k * N) + j] = h;
                c.H[(j * N) + k] = h;
            }
            for (n = 0U; n < NX; n++) c.f[k] += s->B[n] * p[n];
        }
    }
    for (k = 0U; k < N; k++) {
        const double e_y = work->value[(k * MPC_ROWS) + 2U] / work->scale[2];
        const double steering = work->value[(k * MPC_ROWS) + 1U] / work->scale[1];
        c.upper[k] = params->max_rate - work->u[k];
        c.lower[k] = -params->max_rate - work->u[k];
        memset(&c.A[k * N], 0, N * sizeof(double));
        memset(&c.A[(N + k) * N], 0, N * sizeof(double));
        memcpy(&c.A[k * N], c.G[k + 1U][4], (k + 1U) * sizeof(double));
        memcpy(&c.A[(N + k) * N], c.G[k + 1U][0], (k + 1U) * sizeof(double));
        c.upper[N + k] = params->max_steering - steering - c.d[k + 1U][4];
        c.lower[N + k] = -params->max_steering - steering - c.d[k + 1U][4];
        c.upper[(2U * N) + k] = params->max_e_y - e_y - c.d[k + 1U][0];
        c.lower[(2U * N) + k] = -params->max_e_y - e_y - c.d[k + 1U][0];
    }
}

/* As mpc_solve. */
int daqp_iterate(mpc_state *state, const mpc_params *params, mpc_work *work, const double *x0,
    const double *kappa, const double *v_x)
{
    static DAQPProblem problem;
    DAQPResult result;
    uint32_t k, i, j;
    double nothing;
    memcpy(work->kappa, kappa, sizeof work->kappa);
    memcpy(work->v_x, v_x, sizeof work->v_x);
    linearize(state, params, work, x0, MPC_HORIZON);
    measure_rows(state, params, work, MPC_HORIZON);
    condense(work, params);
    result.x = c.x;
    result.lam = c.lambda;
    if (!is_set_up) {
        const DAQPProblem it = { N, M, N, c.H, c.f, c.A, c.upper, c.lower, c.sense };
        problem = it;
        for (k = 2U * N; k < M; k++) c.sense[k] = SOFT;
        memset(&daqp, 0, sizeof daqp);
        if (setup_daqp(&problem, &daqp.it, &nothing) < 0) return -100;
        is_set_up = 1;
    } else {
        deactivate_constraints(&daqp.it);
        reset_daqp_workspace(&daqp.it);
        if (update_ldp(UPDATE_Rinv | UPDATE_M | UPDATE_v | UPDATE_d, &daqp.it) < 0) return -101;
    }
    daqp_solve(&result, &daqp.it);
    for (k = 0U; k < N; k++) {
        work->du[k] = c.x[k];
        for (i = 0U; i < NX; i++) {
            double dx = c.d[k + 1U][i];
            for (j = 0U; j <= k; j++) dx += c.G[k + 1U][i][j] * c.x[j];
            work->dx[k + 1U][i] = dx;
        }
    }
    (void)take(state, params, work);
    state->guessed = 1U; /* there is no feedback */
    return result.exitflag;
}
