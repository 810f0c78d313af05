// Purpose: lets the tests, written against the single header of Catch2 2.13, compile with Catch2 3.
#pragma once

#include <catch2/catch_all.hpp>

using Catch::Approx;
