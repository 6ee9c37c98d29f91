/* Time goes on without a sample; return whether that lasts for too long. */
static bool @name@_is_stale(@name@_state *state@missed_params@)
{
    bool stale = false;
    state->missed += (state->missed < UINT32_MAX) ? 1U : 0U;
@pass@    if (state->missed >= @NAME@_STALE_SAMPLES) {
        const @name@_output nothing = { @zeros@ };
        state->output = nothing;
        stale = true;
    }
    return stale;
}

