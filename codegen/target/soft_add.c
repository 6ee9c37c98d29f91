/* Correct addition of doubles for processors without them.
 *
 * libgcc of GCC 12 for Arm rounds a difference wrongly, by the last bit, where exponents are 33
 * apart and the result loses a bit, as in 1 - 1.6e-10. Linked with --wrap for __aeabi_dadd,
 * __aeabi_dsub and __aeabi_drsub this file takes its place where results shall be compared.
 */
#include <stdint.h>

uint64_t __wrap___aeabi_dadd(uint64_t a, uint64_t b);
uint64_t __wrap___aeabi_dsub(uint64_t a, uint64_t b);
uint64_t __wrap___aeabi_drsub(uint64_t a, uint64_t b);

#define SIGN 0x8000000000000000U
#define SPECIAL 0x7FFU
#define NOT_A_NUMBER 0x7FF8000000000000U
#define HIDDEN 0x0010000000000000U

static uint32_t exponent(uint64_t a)
{
    return (uint32_t)(a >> 52) & SPECIAL;
}

/* Significand with three bits for rounding. */
static uint64_t mantissa(uint64_t a)
{
    const uint64_t fraction = a & (HIDDEN - 1U);
    return ((exponent(a) == 0U) ? fraction : (fraction | HIDDEN)) << 3;
}

static uint64_t shifted(uint64_t x, uint32_t by)
{
    const uint64_t lost = (by < 64U) ? (x & (((uint64_t)1 << by) - 1U)) : x;
    return ((by < 64U) ? (x >> by) : 0U) | ((lost != 0U) ? 1U : 0U);
}

static uint64_t sum_of_special(uint64_t a, uint64_t b)
{
    const uint64_t infinite = (uint64_t)SPECIAL << 52;
    if (((a & ~SIGN) > infinite) || ((b & ~SIGN) > infinite)) {
        return NOT_A_NUMBER;
    }
    if ((exponent(a) == SPECIAL) && (exponent(b) == SPECIAL) && (a != b)) {
        return NOT_A_NUMBER;
    }
    return (exponent(a) == SPECIAL) ? a : b;
}

uint64_t __wrap___aeabi_dadd(uint64_t a, uint64_t b)
{
    uint64_t sum;
    uint32_t e;
    if ((exponent(a) == SPECIAL) || (exponent(b) == SPECIAL)) {
        return sum_of_special(a, b);
    }
    if ((a & ~SIGN) < (b & ~SIGN)) {
        const uint64_t larger = b;
        b = a;
        a = larger;
    }
    e = (exponent(a) == 0U) ? 1U : exponent(a);
    sum = shifted(mantissa(b), e - ((exponent(b) == 0U) ? 1U : exponent(b)));
    if (((a ^ b) & SIGN) == 0U) {
        sum = mantissa(a) + sum;
        if (sum >= (HIDDEN << 4)) {
            sum = shifted(sum, 1U);
            e++;
        }
    } else {
        sum = mantissa(a) - sum;
        if (sum == 0U) {
            return 0U;
        }
        while ((sum < (HIDDEN << 3)) && (e > 1U)) {
            sum <<= 1;
            e--;
        }
    }
    if (sum < (HIDDEN << 3)) {
        e = 0U;
    }
    {
        const uint64_t rounding = sum & 7U;
        uint64_t result = ((uint64_t)e << 52) + ((sum >> 3) & (HIDDEN - 1U));
        if ((rounding > 4U) || ((rounding == 4U) && ((result & 1U) != 0U))) {
            result++; /* a carry out of the fraction goes where it belongs */
        }
        if ((result >> 52) >= SPECIAL) {
            result = (uint64_t)SPECIAL << 52;
        }
        return result | (a & SIGN);
    }
}

uint64_t __wrap___aeabi_dsub(uint64_t a, uint64_t b)
{
    return __wrap___aeabi_dadd(a, b ^ SIGN);
}

uint64_t __wrap___aeabi_drsub(uint64_t a, uint64_t b)
{
    return __wrap___aeabi_dadd(b, a ^ SIGN);
}
