#pragma once
#define ISR(vector) extern "C" void vector()
