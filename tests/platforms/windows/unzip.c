/* What Ecos for Windows starts to unpack an FMU: unzip -o FMU -d FOLDER. Neither Windows nor Wine has such a program, and
   Ecos gets no answer from one of Linux; this copies the FMU as it is unpacked in the folder UNPACKED. */
#include <stdio.h>
#include <stdlib.h>

int main(int argc, char **argv) {
    const char *unpacked = getenv("UNPACKED");
    char command[1000];
    if (argc != 5 || !unpacked) return 2;
    snprintf(command, sizeof command, "xcopy \"%s\" \"%s\" /e /i /y /q", unpacked, argv[4]);
    return system(command);
}
