// A TraX tracker without any library: the first box moves by a pixel per frame.
#include <cstdio>
#include <iostream>
#include <sstream>
#include <string>

int main() {
    std::cout << "@@TRAX:hello \"trax.version=1\" \"trax.image=path;\" \"trax.region=rectangle;\"" << std::endl;
    double x = 0, y = 0, w = 0, h = 0;
    for (std::string line; std::getline(std::cin, line);) {
        if (line.rfind("@@TRAX:quit", 0) == 0) return 0;
        if (line.rfind("@@TRAX:initialize", 0) == 0) {
            std::size_t second = line.find("\" \"") + 3;
            if (std::sscanf(line.c_str() + second, "%lf,%lf,%lf,%lf", &x, &y, &w, &h) != 4) return 2;
        } else {
            x += 1;
        }
        std::size_t start = line.find("file://") + 7;
        std::FILE* image = std::fopen(line.substr(start, line.find('"', start) - start).c_str(), "rb");
        if (image == nullptr) return 3;
        std::fclose(image);
        std::cout << "some output" << std::endl;
        std::ostringstream state;
        state << x << ',' << y << ',' << w << ',' << h;
        std::cout << "@@TRAX:state \"" << state.str() << "\" \"confidence=1.5\"" << std::endl;
    }
}
