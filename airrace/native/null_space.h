/* The Riccati recursion on a null space, null_space.c, see there for the arguments. */
#ifndef AIRRACE_NULL_SPACE_H
#define AIRRACE_NULL_SPACE_H

#include "lanes.h"

#define null_space_riccati VARIANT_NAME(null_space_riccati)

int null_space_riccati(
    int stages, int m, const int *sizes, const double *H, const double *F, const int *rows, const double *C,
    const unsigned char *kept, const double *weights, double shift, double *gains, double *costs, double *ahead,
    int *free);

#endif
