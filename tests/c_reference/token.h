/* Generated. */
#ifndef TOKEN_H
#define TOKEN_H

#define MODEL_TOKEN "{00000000}"

#endif
