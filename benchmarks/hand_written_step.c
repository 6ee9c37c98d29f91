/* The paper's identifier as a person would write it for speed: plain loops, no guards, one copy of
 * the state. The limit that exported C is measured against, compiled with the same flags.
 *
 * xi [kN s], z [kN s^2], W [kN], V [-]; Euler steps of DT; the rational tanh of codegen/elementary.py.
 * Numbers of car and gains come from outside, so that nothing of a generator is in here.
 */
#include <math.h>

#define N_H 10
#define N_IN 4

typedef struct {
    double m, I_z, l_f, l_r, C_f, C_r;                          /* kg, kg m^2, m, N/rad */
    double a, forgetting, eta_W, eta_V, rho_W, rho_V, dt, unit; /* A_d = -a I; U [N] */
    double scale[N_IN];                                         /* of v_y, r, delta_f, delta_r */
} numbers;

typedef struct {
    double xi_hat[2], z[2], W[2][N_H], V[N_IN][N_H];
} memory;

static void squash(double *restrict x)
{
    for (int i = 0; i < N_H; ++i) {
        const double low = x[i] > 12.7 ? 12.7 : x[i];
        const double y = low < -12.7 ? -12.7 : low;
        const double s = y * y;
        double p = 2.2444167437914083e-13, q = 1.6945688293228353e-15;
        p = p * s + 5.558451507317698e-10;
        p = p * s + 3.224479725166911e-07;
        p = p * s + 6.572298819766853e-05;
        p = p * s + 0.005194847354751072;
        p = p * s + 0.14649499840670127;
        p = p * s + 0.999999999998556;
        q = q * s + 1.4077027141943698e-11;
        q = q * s + 1.5480056107175375e-08;
        q = q * s + 5.191172599506885e-06;
        q = q * s + 0.0006582964762723313;
        q = q * s + 0.03180429127631582;
        q = q * s + 0.47982833173275036;
        q = q * s + 1.0;
        x[i] = y * p / q;
    }
}

static void step(const numbers *restrict c, memory *restrict s, const double *restrict in,
                 double *restrict force)
{
    const double v_x = in[0], v_y = in[1], r = in[2], dt = c->dt;
    const double base = 1.0 / ((c->l_f + c->l_r) * c->unit), fast = 1.0 / v_x;
    const double slip[2] = { in[3] - (v_y + c->l_f * r) * fast, in[4] - (v_y - c->l_r * r) * fast };
    const double linear[2] = { c->C_f / c->unit * slip[0], c->C_r / c->unit * slip[1] };
    const double turn = c->m * v_x * r * base; /* the frame turns: m v_x r, shared by the axles */
    const double known[2] = { linear[0] - c->l_r * turn, linear[1] - c->l_f * turn };
    const double error[2] = { (c->m * c->l_r * v_y + c->I_z * r) * base - s->xi_hat[0],
                              (c->m * c->l_f * v_y - c->I_z * r) * base - s->xi_hat[1] };
    const double leak = dt * sqrt(error[0] * error[0] + error[1] * error[1]);
    const double keep_W = 1.0 - c->rho_W * leak, keep_V = 1.0 - c->rho_V * leak;
    const double g[2] = { -s->z[0] / c->a, -s->z[1] / c->a };
    const double x_bar[N_IN] = { v_y * c->scale[0], r * c->scale[1], in[3] * c->scale[2],
                                 in[4] * c->scale[3] };
    double sigma[N_H], slope[N_H], f_hat[2] = { 0.0, 0.0 };
    for (int i = 0; i < N_H; ++i) {
        sigma[i] = s->V[0][i] * x_bar[0] + s->V[1][i] * x_bar[1] + s->V[2][i] * x_bar[2]
            + s->V[3][i] * x_bar[3];
    }
    squash(sigma);
    for (int i = 0; i < N_H; ++i) {
        f_hat[0] += s->W[0][i] * sigma[i];
        f_hat[1] += s->W[1][i] * sigma[i];
        slope[i] = (1.0 - sigma[i] * sigma[i]) * (s->W[0][i] * g[0] + s->W[1][i] * g[1]);
    }
    for (int j = 0; j < N_IN; ++j) {
        const double rate = dt * c->eta_V * x_bar[j];
        for (int i = 0; i < N_H; ++i) {
            s->V[j][i] = keep_V * s->V[j][i] - rate * slope[i];
        }
    }
    for (int k = 0; k < 2; ++k) {
        const double rate = dt * c->eta_W * g[k];
        for (int i = 0; i < N_H; ++i) {
            s->W[k][i] = keep_W * s->W[k][i] - rate * sigma[i];
        }
        s->xi_hat[k] += dt * (c->a * error[k] + known[k] + f_hat[k]);
        s->z[k] += dt * (error[k] - c->forgetting * s->z[k]);
    }
    force[0] = c->unit * (linear[0] + f_hat[0]);
    force[1] = c->unit * (linear[1] + f_hat[1]);
}

/* Run n samples v_x, v_y, r, delta_f, delta_r from a start: xi_hat, z, W by rows, V by columns. */
void run(long n, const double *samples, const double *given, const double *start, double *force)
{
    numbers c;
    memory s;
    for (unsigned i = 0; i < sizeof c / sizeof(double); ++i) {
        ((double *)&c)[i] = given[i];
    }
    for (unsigned i = 0; i < sizeof s / sizeof(double); ++i) {
        ((double *)&s)[i] = start[i];
    }
    for (long k = 0; k < n; ++k) {
        step(&c, &s, samples + 5 * k, force + 2 * k);
    }
}
