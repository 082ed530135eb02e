// Compiled for the header that the tests take over from here.
#include <gtest/gtest.h>
