@covariance_function@@factors_function@@amounts_function@@name@_status @name@_get_weights(const @name@_state *state, @name@_weights *weights)
{
    @name@_status status = @NAME@_BAD_CALL;
    if ((state != NULL) && (weights != NULL)) {
        *weights = state->values.weights;
        status = @NAME@_OK;
    }
    return status;
}

@name@_status @name@_set_weights(@name@_state *state, const @name@_weights *weights)
{
    @name@_status status = @NAME@_BAD_CALL;
    if ((state != NULL) && (weights != NULL)) {
        const @name@_real sum =
@weights_sum@;
        if (@name@_finite(sum)@weights_rules@) {
            state->values.weights = *weights;
            status = @NAME@_OK;
        } else {
            status = @NAME@_BAD_INPUT;
        }
    }
    return status;
}

@name@_status @name@_set_adaptation(@name@_state *state, bool adapts)
{
    @name@_status status = @NAME@_BAD_CALL;
    if (state != NULL) {
        state->adapts = 0U;
        if (adapts) {
            state->adapts = 1U;
        }
        status = @NAME@_OK;
    }
    return status;
}

