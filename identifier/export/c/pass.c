    if (state->started != 0U) { /* where no car is, which the gate does not believe */
        const @name@_input nowhere = { @nowhere@, @NAME@_C(0.0), @NAME@_C(0.0),
            @NAME@_C(0.0), @NAME@_C(0.0) };
        (void)@name@_advance(state, params, &nowhere);
    }
