/* Sum of n numbers, which is finite only where all of them are; in parts that may run abreast. */
static @name@_real @name@_sum(const @name@_real *x, uint32_t n)
{
    @name@_real a = @NAME@_C(0.0);
    @name@_real b = @NAME@_C(0.0);
    @name@_real c = @NAME@_C(0.0);
    @name@_real d = @NAME@_C(0.0);
    @name@_real e = @NAME@_C(0.0);
    @name@_real f = @NAME@_C(0.0);
    @name@_real g = @NAME@_C(0.0);
    @name@_real h = @NAME@_C(0.0);
    uint32_t i = 0U;
    for (; (i + 8U) <= n; i += 8U) {
        a += x[i];
        b += x[i + 1U];
        c += x[i + 2U];
        d += x[i + 3U];
        e += x[i + 4U];
        f += x[i + 5U];
        g += x[i + 6U];
        h += x[i + 7U];
    }
    for (; i < n; i++) {
        a += x[i];
    }
    return ((a + b) + (c + d)) + ((e + f) + (g + h));
}

