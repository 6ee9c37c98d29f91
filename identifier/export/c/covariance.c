/* Whether the upper triangle of a symmetric matrix, by rows, is that of a covariance: in no direction
 * is its variance negative by more than rounding. @layout@ */
static bool @name@_is_covariance(const @name@_real *upper)
{
    @name@_real low[@order@][@order@];
    @name@_real pivot[@order@];
    bool is = true;
    uint32_t at = 0U;
    uint32_t i;
    uint32_t j;
    uint32_t k;
    for (i = 0U; i < @order@U; i++) {
        at += @skip@;
        for (j = i; j < @order@U; j++) {
            low[j][i] = upper[at];
            at++;
        }
    }
    for (j = 0U; j < @order@U; j++) {
        pivot[j] = low[j][j] * (@NAME@_C(1.0) + @NAME@_C(@slack@));
        is = is && (low[j][j] >= @NAME@_C(0.0));
        for (k = 0U; k < j; k++) {
            pivot[j] -= low[j][k] * low[j][k] * pivot[k];
        }
        for (i = j + 1U; i < @order@U; i++) {
            for (k = 0U; k < j; k++) {
                low[i][j] -= low[i][k] * low[j][k] * pivot[k];
            }
            if (pivot[j] > @NAME@_C(0.0)) {
                low[i][j] /= pivot[j];
            } else { /* what never varies, varies with nothing */
                is = is && @name@_within(low[i][j], @NAME@_C(0.0));
            }
        }
        is = is && (pivot[j] >= @NAME@_C(0.0));
    }
    return is;
}

