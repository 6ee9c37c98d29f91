    check(memcmp(&state->values.weights, &before.values.weights, sizeof before.values.weights) == 0,
        "nothing is learnt from what is refused");
