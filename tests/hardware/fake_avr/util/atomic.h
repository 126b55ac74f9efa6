#pragma once
#define ATOMIC_BLOCK(type) for (bool once = true; once; once = false)
