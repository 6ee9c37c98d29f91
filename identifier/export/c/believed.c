/* Whether a step went on with this sample, and not with the last one that it believed. */
static bool @name@_believed(const @name@_values *next, const @name@_input *in)
{
    return (next->@believed@[0] == in->v_x) && (next->@believed@[1] == in->v_y)
        && (next->@believed@[2] == in->r) && (next->@believed@[3] == in->delta_f)
        && (next->@believed@[4] == in->delta_r);
}

