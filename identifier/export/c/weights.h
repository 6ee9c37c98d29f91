/* Weights now; to store them, and to begin with them another day. */
@name@_status @name@_get_weights(const @name@_state *state, @name@_weights *weights);

/* Go on with these weights; refused with @NAME@_BAD_INPUT, and nothing changed, where one is not
 * finite, or a covariance, an error or a time among them is negative. */
@name@_status @name@_set_weights(@name@_state *state, const @name@_weights *weights);

/* true: learn (as after @name@_init). false: frozen, weights hold their values. */
@name@_status @name@_set_adaptation(@name@_state *state, bool adapts);

