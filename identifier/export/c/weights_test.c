static void test_modes(@name@_state *state, const @name@_params *params)
{
    const @name@_real zero = 0;
    @name@_weights learnt;
    @name@_weights after;
    @name@_weights broken;
    (void)memset(&learnt, 0, sizeof learnt);
    (void)memset(&after, 0, sizeof after);
    (void)@name@_get_weights(state, &learnt);
    (void)@name@_set_adaptation(state, false);
    (void)@name@_reset(state);
    (void)drive(state, params, VECTORS);
    (void)@name@_get_weights(state, &after);
    check(memcmp(&learnt, &after, sizeof learnt) == 0, "frozen weights hold their values");
    (void)@name@_set_adaptation(state, true);
    (void)drive(state, params, VECTORS);
    (void)@name@_get_weights(state, &after);
    check(memcmp(&learnt, &after, sizeof learnt) != 0, "adaptation moves the weights");
    (void)@name@_set_weights(state, &learnt);
    (void)@name@_get_weights(state, &after);
    check(memcmp(&learnt, &after, sizeof learnt) == 0, "weights that were set are kept");
    broken = learnt;
    broken.@first_weight@ = zero / zero;
    check(@name@_set_weights(state, &broken) == @NAME@_BAD_INPUT, "NaN is no weight");
@negative_test@}

