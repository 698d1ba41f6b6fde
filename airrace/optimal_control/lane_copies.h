/* How numbers come to the lanes and back: interval after interval, or row by row.
 *
 * Before this text stands lanes.h.
 */

/* numbers of one interval after those of another, to the lanes and back */

static void gather(const double *from, int size, real *to)
{
    for (int i = 0; i < size; i++)
        for (int lane = 0; lane < LANES; lane++) to[i][lane] = from[lane * size + i];
}

static void scatter(const real *from, int size, double *to)
{
    for (int lane = 0; lane < LANES; lane++)
        for (int i = 0; i < size; i++) to[lane * size + i] = from[i][lane];
}

/* Rows of `count` numbers, one per point. The lanes beyond the last point repeat it. */

static void gather_rows(const double *from, int rows, integer first, integer count, real *to)
{
    for (int r = 0; r < rows; r++)
        for (int lane = 0; lane < LANES; lane++)
            to[r][lane] = from[r * count + (first + lane < count ? first + lane : count - 1)];
}

static void scatter_rows(const real *from, int rows, integer first, integer count, double *to)
{
    for (int r = 0; r < rows; r++)
        for (int lane = 0; lane < LANES && first + lane < count; lane++) to[r * count + first + lane] = from[r][lane];
}
