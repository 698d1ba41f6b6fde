/* One interval at a time: a `real` is a number, where lanes.h has vectors. */

#include <math.h>

typedef double real;
typedef long long int integer;

#if defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#define INLINE static inline __attribute__((always_inline))
#else
#define EXPORT
#define INLINE static inline
#endif

#define all(number) (number)
