/* What the program needs from the machine that it runs on. */
#ifndef MACHINE_H
#define MACHINE_H

#include <stdint.h>

int main(void);
void machine_print(const char *text);
void machine_start_clock(void);
uint32_t machine_instructions(void);
void machine_paint_stack(void);
uint32_t machine_painted_stack_used(void);

#endif
