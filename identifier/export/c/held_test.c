    {
        /* But for the rounding of a projection onto their bounds. */
        const double rounding = (sizeof(@name@_real) == sizeof(float)) ? 1e-6 : 1e-14;
        const @name@_weights *const now = &state->values.weights;
        @name@_real old[sizeof *now / sizeof(@name@_real)];
        @name@_real held[sizeof *now / sizeof(@name@_real)];
        size_t i;
        bool same = true;
        (void)memcpy(old, &before.values.weights, sizeof old);
        (void)memcpy(held, now, sizeof held);
        for (i = 0; i < (sizeof old / sizeof old[0]); i++) {
            const double size = 1.0 + fabs((double)old[i]);
            same = same && (fabs((double)held[i] - (double)old[i]) <= (rounding * size));
        }
        check(same, "nothing is learnt from what is refused");
    }
