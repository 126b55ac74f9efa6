// Entry point where no Arduino core brings its own.
#include "tvc_gimbal/board.h"

int main() {
  board::begin();
  for (;;) board::poll();
}
