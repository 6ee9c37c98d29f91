/* Rest at a sample: observers take the measurement, filters begin anew, weights stay. */
static void @name@_begin(@name@_state *state, const @name@_params *params, const @name@_input *input)
{
    @name@_values next;
    @name@_output out;
    @name@_input rest = *input;
    rest.v_x = @NAME@_C(0.0);
    @name@_@at_rest@(&state->values, &rest, &next, &out);
    if (@name@_believes(params, &next, &out)) {
        state->values = next;
    }
}

