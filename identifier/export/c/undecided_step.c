    @name@_driving(&state->values, input, &next, &out);
    status = (input->v_x < (@name@_real)@NAME@_MIN_SPEED) ? @NAME@_REST : @NAME@_OK;
@judge@