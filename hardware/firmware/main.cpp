// Entry point of builds without the Arduino core.
#include "tvc_gimbal/board.h"

int main() {
  board::begin();
  for (;;) board::poll();
}
