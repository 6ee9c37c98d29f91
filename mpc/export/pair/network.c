#define UNITS @units@U
#define INPUTS @inputs@U
#define FORCE_UNIT ((real)@force_unit@) /* of the weights [N] */

static const real stiffness[2] = { @stiffness@ }; /* of the linear tire that they correct [N/rad] */
static const real scale[INPUTS] = { @scale@ };    /* of the inputs [SI] */

/* Weights of the prediction: stiffness, W and V by columns, in N and SI. */
static bool convert(const tireid_weights *learnt, real w[WEIGHTS])
{
    bool is_tire = true;
    uint32_t i;
    uint32_t j;
    uint32_t k;
    for (i = 0U; i < 2U; i++) {
        real most = (real)0.0;
        w[i] = stiffness[i];
        for (j = 0U; j < UNITS; j++) {
            const real force = FORCE_UNIT * (real)learnt->W[i][j];
            w[2U + (2U * j) + i] = force;
            most += (force < (real)0.0) ? -force : force;
        }
        is_tire = is_tire && (most <= MAX_FORCE); /* which NaN is not */
    }
    for (k = 0U; k < INPUTS; k++) {
        for (j = 0U; j < UNITS; j++) {
            const real v = (real)learnt->V[j][k] / scale[k];
            w[2U + (2U * UNITS) + (k * UNITS) + j] = v;
            is_tire = is_tire && ((v - v) <= (real)0.0);
        }
    }
    return is_tire;
}

