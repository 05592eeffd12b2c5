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

/* l has as many numbers as there are bilateral constraints, v those of a global problem */
static void print_points(const char *path, int nv, int nr, int nl)
{
  struct fclib_solution *s = fclib_read_solution(path);
  if (nv) print_vector("solution.v", s->v, nv);
  print_vector("solution.u", s->u, nr);
  print_vector("solution.r", s->r, nr);
  if (nl) print_vector("solution.l", s->l, nl);
  int count = 0;
  struct fclib_solution *g = fclib_read_guesses(path, &count);
  printf("guesses %d\n", count);
  for (int k = 0; k < count; k++)
  {
    if (nv) print_vector("guess.v", g[k].v, nv);
    print_vector("guess.r", g[k].r, nr);
    if (nl) print_vector("guess.l", g[k].l, nl);
  }
}

int main(int argc, char **argv)
{
  int points = argc == 4 && !strcmp(argv[3], "points");
  if (argc >= 3 && !strcmp(argv[1], "local"))
  {
    struct fclib_local *p = fclib_read_local(argv[2]);
    if (!p) return 1;
    printf("spacedim %d\n", p->spacedim);
    print_matrix("W", p->W);
    print_vector("q", p->q, p->W->m);
    print_vector("mu", p->mu, p->W->m / p->spacedim);
    if (p->V)
    {
      print_matrix("V", p->V);
      print_matrix("R", p->R);
      print_vector("s", p->s, p->R->m);
    }
    print_info(p->info);
    if (points) print_points(argv[2], 0, p->W->m, p->V ? p->R->m : 0);
    return 0;
  }
  if (argc >= 3 && !strcmp(argv[1], "global"))
  {
    struct fclib_global *p = fclib_read_global(argv[2]);
    if (!p) return 1;
    printf("spacedim %d\n", p->spacedim);
    print_matrix("M", p->M);
    print_matrix("H", p->H);
    print_vector("f", p->f, p->M->m);
    print_vector("w", p->w, p->H->n);
    print_vector("mu", p->mu, p->H->n / p->spacedim);
    if (p->G)
    {
      print_matrix("G", p->G);
      print_vector("b", p->b, p->G->n);
    }
    print_info(p->info);
    if (points) print_points(argv[2], p->M->m, p->H->n, p->G ? p->G->n : 0);
    return 0;
  }
  return 2;
}
