#include "lines.geom"
