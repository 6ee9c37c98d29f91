/* Takes what `replayed.h` of a package gives through the package; prints a hash of all that came out,
 * and what it cost. */
#include "machine.h"
#include "replayed.h"

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

/* Instructions between two readings of a counter that wraps. */
static uint32_t since(uint32_t before, uint32_t after)
{
    return (after >= before) ? (after - before) : ((after + (0x1000000U * 40U)) - before);
}

int main(void)
{
    uint64_t hash = 14695981039346656037U;
    uint64_t total = 0U;
    uint32_t most = 0U;
    uint32_t steps = 0U;
    uint32_t counted = 0U;
    uint32_t stack = 0U;
    replayed_begin();
    machine_start_clock();
    while (replayed_next(steps) != 0) {
        uint32_t code; /* an enum has not the same size everywhere */
        uint32_t before;
        uint32_t spent;
        if ((steps % SPOT) == 0U) {
            machine_paint_stack();
        }
        before = machine_instructions();
        code = replayed_step();
        spent = since(before, machine_instructions());
        if ((steps % SPOT) == 0U) {
            const uint32_t used = machine_painted_stack_used();
            stack = (used > stack) ? used : stack;
        }
        if (code <= COUNTS) {
            total += spent;
            counted++;
        }
        most = (spent > most) ? spent : most;
        steps++;
        hash = hash_bytes(hash, &state, (uint32_t)sizeof state);
        hash = hash_bytes(hash, &code, (uint32_t)sizeof code);
    }
    print("hash", hash);
    print("stack", stack);
    print("steps", steps);
    print("instructions", (counted > 0U) ? (total / counted) : 0U);
    print("most_instructions", most);
    print("state", (uint64_t)sizeof state);
    print("params", (uint64_t)sizeof params);
    print("work", WORK);
    print("faults", FAULTS);
    return 0;
}
