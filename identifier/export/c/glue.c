/* What Python asks of an instance, in one translation unit with the library: see compiled.py. */
#include <string.h>

#include "tireid.h"

typedef struct {
    tireid_state state;
    tireid_params params;
} tireid_instance;

size_t tireid_instance_size(void);
void tireid_instance_init(tireid_instance *it);
void tireid_instance_reset(tireid_instance *it);
void tireid_instance_run(
    tireid_instance *it, long n, const double *samples, double *output, int *status);
unsigned tireid_instance_faults(const tireid_instance *it);

size_t tireid_instance_size(void)
{
    return sizeof(tireid_instance);
}

void tireid_instance_init(tireid_instance *it)
{
    (void)memset(it, 0, sizeof *it);
    (void)tireid_default_params(&it->params);
    (void)tireid_init(&it->state);
}

void tireid_instance_reset(tireid_instance *it)
{
    (void)tireid_reset(&it->state);
}

/* Samples are rows of all numbers of tireid_input, outputs rows of those of tireid_output. */
void tireid_instance_run(
    tireid_instance *it, long n, const double *samples, double *output, int *status)
{
    tireid_real sample[sizeof(tireid_input) / sizeof(tireid_real)];
    tireid_real numbers[sizeof(tireid_output) / sizeof(tireid_real)];
    const size_t width = sizeof sample / sizeof sample[0];
    const size_t size = sizeof numbers / sizeof numbers[0];
    long k;
    size_t i;
    for (k = 0; k < n; k++) {
        tireid_input input;
        for (i = 0; i < width; i++) {
            sample[i] = (tireid_real)samples[((size_t)k * width) + i];
        }
        (void)memcpy(&input, sample, sizeof input);
        status[k] = (int)tireid_step(&it->state, &it->params, &input);
        (void)memcpy(numbers, &it->state.output, sizeof numbers);
        for (i = 0; i < size; i++) {
            output[((size_t)k * size) + i] = (double)numbers[i];
        }
    }
}

unsigned tireid_instance_faults(const tireid_instance *it)
{
    return it->state.faults;
}

#if TIREID_LEARNS
void tireid_instance_adapt(tireid_instance *it, int adapts);
void tireid_instance_weights(const tireid_instance *it, double *flat);
int tireid_instance_take(tireid_instance *it, const double *flat);

void tireid_instance_adapt(tireid_instance *it, int adapts)
{
    (void)tireid_set_adaptation(&it->state, adapts != 0);
}

void tireid_instance_weights(const tireid_instance *it, double *flat)
{
    tireid_weights weights;
    tireid_real numbers[sizeof weights / sizeof(tireid_real)] = { 0 };
    size_t i;
    (void)tireid_get_weights(&it->state, &weights);
    (void)memcpy(numbers, &weights, sizeof weights);
    for (i = 0; i < (sizeof numbers / sizeof numbers[0]); i++) {
        flat[i] = (double)numbers[i];
    }
}

int tireid_instance_take(tireid_instance *it, const double *flat)
{
    tireid_weights weights;
    tireid_real numbers[sizeof weights / sizeof(tireid_real)] = { 0 };
    size_t i;
    for (i = 0; i < (sizeof numbers / sizeof numbers[0]); i++) {
        numbers[i] = (tireid_real)flat[i];
    }
    (void)memcpy(&weights, numbers, sizeof weights);
    return (int)tireid_set_weights(&it->state, &weights);
}
#endif
