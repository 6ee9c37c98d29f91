static bool @name@_are_not_negative(const @name@_real *x, uint32_t n)
{
    bool are = true;
    uint32_t i;
    for (i = 0U; i < n; i++) {
        are = are && (x[i] >= @NAME@_C(0.0));
    }
    return are;
}

