// The counter of the tests, in this program too.
#include "tests/core/allocations.cpp"
