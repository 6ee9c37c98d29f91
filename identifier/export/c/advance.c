/* Take a sample that is accepted, where the result can be believed. */
static @name@_status @name@_advance(@name@_state *state, const @name@_params *params,
    const @name@_input *input)
{
    @name@_values next;
    @name@_output out;
    @name@_status status;
@compute@@hold@    if (@name@_believes(params, &next, &out)) {
        state->values = next;
        state->output = out;
        state->started = 1U;
    } else {
        status = @NAME@_BAD_RESULT;
    }
    return status;
}

