    if (state->started != 0U) { /* where no car is, which the gate does not believe */
        const @name@_input nowhere = { @nowhere@ };
        (void)@name@_advance(state, params, &nowhere);
    }
