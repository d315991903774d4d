/* Times RTKLIB's lambda() on the problems of a file, for the bench `lambda`.
 *
 * The file holds, in the machine's own byte order, for each problem: n as a 64-bit integer, n float ambiguities and
 * their n x n covariance as doubles. Printed for each: the best of REPEAT runs in microseconds, and 0 or what lambda()
 * says where it gives up.
 *
 * cc -O2 lambda_peer.c -lRTKLib
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define REPEAT 5

int lambda(int n, int m, const double *a, const double *Q, double *F, double *s);

/* What the library expects of a program that processes files; lambda() calls none of it. */
int showmsg(char *format, ...) { (void)format; return 0; }
void settspan(void) {}
void settime(void) {}

static double now_us(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e6 * t.tv_sec + 1e-3 * t.tv_nsec;
}

int main(int argc, char **argv)
{
    FILE *file = argc > 1 ? fopen(argv[1], "rb") : NULL;
    int64_t n;
    if (!file) return 1;
    while (fread(&n, sizeof n, 1, file) == 1) {
        double *a = malloc(n * sizeof *a), *q = malloc(n * n * sizeof *q), *fixed = malloc(2 * n * sizeof *fixed);
        double norms[2], best = 1e300;
        int failed = 0;
        if (fread(a, sizeof *a, n, file) != (size_t)n || fread(q, sizeof *q, n * n, file) != (size_t)(n * n)) return 1;
        for (int k = 0; k < REPEAT; k++) {
            double start = now_us(), took;
            failed = lambda((int)n, 2, a, q, fixed, norms);
            took = now_us() - start;
            if (took < best) best = took;
        }
        printf("%.3f %d\n", best, failed);
        free(a);
        free(q);
        free(fixed);
    }
    fclose(file);
    return 0;
}
