/* Runs a recording through the package and prints a hash of all that came out, and what it cost. */
#include "tireid.h"
#include "machine.h"

#define SPOT 16U /* the stack is looked at each so many steps */

#define INPUTS (sizeof(tireid_input) / sizeof(tireid_real))

typedef struct {
    double value[INPUTS];
} sample;

extern const sample recorded_samples[];
extern const sample recorded_end[];

static tireid_state state; /* in .bss: bytes between its members are zero everywhere */

static uint64_t hash_bytes(uint64_t hash, const void *start, uint32_t size)
{
    const uint8_t *byte = (const uint8_t *)start;
    uint32_t i;
    for (i = 0U; i < size; i++) {
        hash = (hash ^ byte[i]) * 1099511628211U; /* FNV-1a */
    }
    return hash;
}

static void print(const char *key, uint64_t number)
{
    char text[20];
    int i;
    for (i = 15; i >= 0; i--) {
        text[i] = "0123456789abcdef"[number & 15U];
        number >>= 4;
    }
    text[16] = '\n';
    text[17] = '\0';
    machine_print(key);
    machine_print(" ");
    machine_print(text);
}

/* A sample in the precision of the package. */
static tireid_input input_of(const sample *at)
{
    union {
        tireid_real number[INPUTS];
        tireid_input input;
    } both;
    uint32_t i;
    for (i = 0U; i < INPUTS; i++) {
        both.number[i] = (tireid_real)at->value[i];
    }
    return both.input;
}

int main(void)
{
    tireid_params params;
    uint64_t hash = 14695981039346656037U;
    uint64_t total = 0U;
    uint32_t most = 0U;
    uint32_t steps = 0U;
    uint32_t driven = 0U;
    uint32_t stack = 0U;
    const sample *at;
    (void)tireid_default_params(&params);
    (void)tireid_init(&state);
    machine_start_clock();
    for (at = recorded_samples; at != recorded_end; at++) {
        const tireid_input input = input_of(at);
        uint32_t code; /* an enum has not the same size everywhere */
        uint32_t before;
        uint32_t spent;
        if ((steps % SPOT) == 0U) {
            machine_paint_stack();
        }
        before = machine_instructions();
        code = (uint32_t)tireid_step(&state, &params, &input);
        spent = machine_instructions() - before;
        spent = (spent > 0x80000000U) ? 0U : spent; /* the counter wrapped */
        if ((steps % SPOT) == 0U) {
            const uint32_t used = machine_painted_stack_used();
            stack = (used > stack) ? used : stack;
        }
        if (code == (uint32_t)TIREID_OK) {
            total += spent;
            driven++;
        }
        most = (spent > most) ? spent : most;
        steps++;
        hash = hash_bytes(hash, &state, (uint32_t)sizeof state);
        hash = hash_bytes(hash, &code, (uint32_t)sizeof code);
    }
    print("hash", hash);
    print("stack", stack);
    print("steps", steps);
    print("instructions", (driven > 0U) ? (total / driven) : 0U);
    print("most_instructions", most);
    print("state", (uint64_t)sizeof state);
    print("params", (uint64_t)sizeof params);
    print("faults", state.faults);
    return 0;
}
