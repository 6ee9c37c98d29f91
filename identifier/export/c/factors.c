/* Whether the diagonal of an upper triangle, by rows, holds no negative number: D of U D U'. */
static bool @name@_are_factors(const @name@_real *upper)
{
    bool are = true;
    uint32_t at = 0U;
    uint32_t i;
    for (i = @order@U; i > 0U; i--) {
        are = are && (upper[at] >= @NAME@_C(0.0));
        at += i;
    }
    return are;
}

