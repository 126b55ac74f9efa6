#pragma once
void _delay_us(double duration);  // of the test
