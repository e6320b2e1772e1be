/* Every robot drives to its first target: a WebAssembly module in C. Layout of views and commands: docs/controllers.md.
 *
 * Build: clang --target=wasm32 -O2 -ffreestanding -nostdlib -Wl,--no-entry -o go_to_point.wasm go_to_point.c
 */
#define EXPORT(name) __attribute__((export_name(name)))
#define IMPORT(name) __attribute__((import_module("robopheus"), import_name(name)))

enum { ROBOT_WORDS = 24, ORDER_WORDS = 16, VIEW_WORDS = 8192, ROBOTS = 50 };

IMPORT("hypot") extern double hypot(double x, double y);

static double view_buffer[VIEW_WORDS];
static double commands[ROBOTS * ORDER_WORDS];

EXPORT("buffer") double *buffer(int words) {
  if (words > VIEW_WORDS) __builtin_trap();
  return view_buffer;
}

EXPORT("step") double *step(const double *view, int words) {
  (void)words;
  const double *robot = view + (int)view[8];
  const double *targets = view + (int)view[10];
  double *command = commands;
  for (int left = (int)view[3]; left > 0; left--, robot += ROBOT_WORDS, command += ORDER_WORDS) {
    for (int k = 0; k < ORDER_WORDS; k++) command[k] = 0.0;
    command[0] = 1.0;
    command[10] = 1.0;
    if (robot[11] == 0.0) continue;
    const double *goal = targets + 3 * (int)robot[12];
    double dx = goal[0] - robot[0], dy = goal[1] - robot[1], distance = hypot(dx, dy);
    command[11] = 1.0;
    command[12] = goal[0];
    command[13] = goal[1];
    if (distance > 0.04) {
      double scale = (1.5 * distance < 0.4 ? 1.5 * distance : 0.4) / distance;
      command[0] = 2.0;
      command[1] = scale * dx;
      command[2] = scale * dy;
      command[3] = __builtin_nan("");
      command[10] = 0.0;
    }
  }
  return commands;
}
