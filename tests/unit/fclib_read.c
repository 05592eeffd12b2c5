/* Reads a problem with FCLIB's own C library and prints what it found, for comparison with what was written. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <fclib.h>

static void print_matrix(const char *name, const struct fclib_matrix *A)
{
  int count = A->nz >= 0 ? A->nz : A->p[A->nz == -1 ? A->n : A->m];
  double sum = 0, weighted = 0;
  for (int k = 0; k < count; k++)
  {
    sum += A->x[k];
    weighted += A->x[k] * (1 + A->i[k]);
  }
  printf("%s %d %d %d %d %.17g %.17g\n", name, A->m, A->n, A->nz, count, sum, weighted);
}

static void print_vector(const char *name, const double *x, int n)
{
  double weighted = 0;
  for (int k = 0; k < n; k++) weighted += x[k] * (k + 1);
  printf("%s %d %.17g\n", name, n, weighted);
}

static void print_info(const struct fclib_info *info)
{
  if (info && info->title) printf("title %s\n", info->title);
}

int main(int argc, char **argv)
{
  if (argc == 3 && !strcmp(argv[1], "local"))
  {
    struct fclib_local *p = fclib_read_local(argv[2]);
    if (!p) return 1;
    printf("spacedim %d\n", p->spacedim);
    print_matrix("W", p->W);
    print_vector("q", p->q, p->W->m);
    print_vector("mu", p->mu, p->W->m / p->spacedim);
    print_info(p->info);
    return 0;
  }
  if (argc == 3 && !strcmp(argv[1], "global"))
  {
    struct fclib_global *p = fclib_read_global(argv[2]);
    if (!p) return 1;
    printf("spacedim %d\n", p->spacedim);
    print_matrix("M", p->M);
    print_matrix("H", p->H);
    print_vector("f", p->f, p->M->m);
    print_vector("w", p->w, p->H->n);
    print_vector("mu", p->mu, p->H->n / p->spacedim);
    print_info(p->info);
    return 0;
  }
  return 2;
}
