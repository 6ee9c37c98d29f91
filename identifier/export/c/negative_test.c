    broken = learnt;
    broken.@first_rule@ = -1;
    check(@name@_set_weights(state, &broken) == @NAME@_BAD_INPUT, "no variance is negative");
    (void)@name@_get_weights(state, &after);
    check(memcmp(&learnt, &after, sizeof learnt) == 0, "refused weights change nothing");
