    if (@name@_drives(input)) {
        @name@_driving(&state->values, input, &next, &out);
        status = @NAME@_OK;
    } else {
        @name@_elsewhere(&state->values, input, &next, &out);
        status = (input->v_x < (@name@_real)@NAME@_MIN_SPEED) ? @NAME@_REST : @NAME@_IMPLAUSIBLE;
    }
