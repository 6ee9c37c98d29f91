/* Generated. */
#ifndef TOKEN_H
#define TOKEN_H

#define MODEL_TOKEN "{00000000}"

#ifndef MODEL_FMI
#define MODEL_FMI 2 /* of the standard */
#endif

#endif
