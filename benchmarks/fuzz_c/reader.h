/* What both harnesses share: the bytes of libFuzzer as choices and numbers, checks, the budget. */
#ifndef READER_H
#define READER_H

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define STATUSES 16U

typedef struct {
    const uint8_t *data;
    size_t left;
} reader;

static unsigned long long steps;
static unsigned long long inputs;
static unsigned long long statuses[STATUSES];

/* A rule that holds after every call; libFuzzer keeps the input that breaks one. */
#define CHECK(rule)                                                                                \
    do {                                                                                           \
        if (!(rule)) {                                                                             \
            (void)fprintf(stderr, "BROKEN: %s, line %d\n", #rule, __LINE__);                       \
            __builtin_trap();                                                                      \
        }                                                                                          \
    } while (0)

static uint32_t take_byte(reader *from)
{
    uint32_t byte = 0U;
    if (from->left > 0U) {
        byte = *from->data;
        from->data++;
        from->left--;
    }
    return byte;
}

/* A number from low to high. */
static double between(reader *from, double low, double high)
{
    const double share = (double)((take_byte(from) << 8U) | take_byte(from)) / 65535.0;
    return low + ((high - low) * share);
}

/* A number that no sensor should deliver: the ends of what there is, any bits, any size. */
static double hostile(reader *from)
{
    static const double odd[] = { NAN, INFINITY, -INFINITY, 1e308, -1e308, 1.7976931348623157e308,
        3.4e38, -3.4e38, 1e30, -1e30, 1e18, 1e-30, 4.9e-324, -4.9e-324, 1e-45, 0.0, -0.0, 1.0, -1.0,
        1e3, -1e3, 1e9, 3.15, -1.5707963267948966 };
    const uint32_t kind = take_byte(from);
    double number = odd[kind % (sizeof odd / sizeof odd[0])];
    if (kind >= 224U) {
        uint8_t bits[sizeof number];
        size_t i;
        for (i = 0U; i < sizeof bits; i++) {
            bits[i] = (uint8_t)take_byte(from);
        }
        (void)memcpy(&number, bits, sizeof bits);
    } else if (kind >= 160U) {
        number = between(from, -1.0, 1.0) * pow(10.0, between(from, -8.0, 8.0));
    } else {
        /* one of the list */
    }
    return number;
}

/* Count a step; end once there were FUZZ_STEPS of them, past what libFuzzer does at an exit. */
static void count_step(unsigned status)
{
    static unsigned long long budget;
    if (budget == 0U) {
        const char *told = getenv("FUZZ_STEPS");
        budget = (told != NULL) ? strtoull(told, NULL, 10) : UINT64_MAX;
    }
    CHECK(status < STATUSES);
    statuses[status]++;
    steps++;
    if (steps >= budget) {
        unsigned i;
        (void)printf("steps %llu inputs %llu statuses", steps, inputs);
        for (i = 0U; i < STATUSES; i++) {
            (void)printf(" %llu", statuses[i]);
        }
        (void)printf("\n");
        (void)fflush(stdout);
        _exit(0);
    }
}

#endif
