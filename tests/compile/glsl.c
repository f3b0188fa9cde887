/* The shaders in the first comment of isogi_trace.h, run: light that they show against that of isogi_trace_sample, in every format of
   export. tests/compile/glsl.sh takes them out of the comment, and builds and runs this where there are the headers of EGL and OpenGL, and
   a driver that needs no screen (Mesa's llvmpipe is one).

       glsl IRRADIANCE.frag TRANSFER.frag

   Points of the surface are drawn as pixels of one picture of floats, their grid coordinates given to them as attributes. */
#define EGL_NO_X11
#include "isogi_trace.h"
#include "daylight.h"
#include "procedural.h"
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GL/glcorearb.h>
#include <stdio.h>

enum { SIDE = 40, WIDTH = 64, COUNT = WIDTH * WIDTH };

/* ---- OpenGL without a window ---- */

#define FUNCTIONS(X)                                                                                                                       \
    X(PFNGLCREATESHADERPROC, CreateShader)                                                                                                 \
    X(PFNGLSHADERSOURCEPROC, ShaderSource)                                                                                                 \
    X(PFNGLCOMPILESHADERPROC, CompileShader)                                                                                               \
    X(PFNGLCREATEPROGRAMPROC, CreateProgram)                                                                                               \
    X(PFNGLATTACHSHADERPROC, AttachShader)                                                                                                 \
    X(PFNGLLINKPROGRAMPROC, LinkProgram)                                                                                                   \
    X(PFNGLGETPROGRAMIVPROC, GetProgramiv)                                                                                                 \
    X(PFNGLGETPROGRAMINFOLOGPROC, GetProgramInfoLog)                                                                                       \
    X(PFNGLUSEPROGRAMPROC, UseProgram)                                                                                                     \
    X(PFNGLGETUNIFORMLOCATIONPROC, GetUniformLocation)                                                                                     \
    X(PFNGLUNIFORM1IVPROC, Uniform1iv)                                                                                                     \
    X(PFNGLUNIFORM3FVPROC, Uniform3fv)                                                                                                     \
    X(PFNGLUNIFORM4FVPROC, Uniform4fv)                                                                                                     \
    X(PFNGLGENTEXTURESPROC, GenTextures)                                                                                                   \
    X(PFNGLDELETETEXTURESPROC, DeleteTextures)                                                                                             \
    X(PFNGLACTIVETEXTUREPROC, ActiveTexture)                                                                                               \
    X(PFNGLBINDTEXTUREPROC, BindTexture)                                                                                                   \
    X(PFNGLTEXPARAMETERIPROC, TexParameteri)                                                                                               \
    X(PFNGLPIXELSTOREIPROC, PixelStorei)                                                                                                   \
    X(PFNGLTEXIMAGE3DPROC, TexImage3D)                                                                                                     \
    X(PFNGLTEXIMAGE2DPROC, TexImage2D)                                                                                                     \
    X(PFNGLGENFRAMEBUFFERSPROC, GenFramebuffers)                                                                                           \
    X(PFNGLBINDFRAMEBUFFERPROC, BindFramebuffer)                                                                                           \
    X(PFNGLFRAMEBUFFERTEXTURE2DPROC, FramebufferTexture2D)                                                                                 \
    X(PFNGLCHECKFRAMEBUFFERSTATUSPROC, CheckFramebufferStatus)                                                                             \
    X(PFNGLVIEWPORTPROC, Viewport)                                                                                                         \
    X(PFNGLCLEARCOLORPROC, ClearColor)                                                                                                     \
    X(PFNGLCLEARPROC, Clear)                                                                                                               \
    X(PFNGLGENVERTEXARRAYSPROC, GenVertexArrays)                                                                                           \
    X(PFNGLBINDVERTEXARRAYPROC, BindVertexArray)                                                                                           \
    X(PFNGLGENBUFFERSPROC, GenBuffers)                                                                                                     \
    X(PFNGLBINDBUFFERPROC, BindBuffer)                                                                                                     \
    X(PFNGLBUFFERDATAPROC, BufferData)                                                                                                     \
    X(PFNGLENABLEVERTEXATTRIBARRAYPROC, EnableVertexAttribArray)                                                                           \
    X(PFNGLVERTEXATTRIBPOINTERPROC, VertexAttribPointer)                                                                                   \
    X(PFNGLDRAWARRAYSPROC, DrawArrays)                                                                                                     \
    X(PFNGLREADPIXELSPROC, ReadPixels)                                                                                                     \
    X(PFNGLGETERRORPROC, GetError)

#define DECLARE(type, name) static type gl##name;
FUNCTIONS(DECLARE)

static void fail(const char *what) {
    fprintf(stderr, "glsl: %s\n", what);
    exit(1);
}

/* There is no driver that could run shaders here. */
static void leave(const char *what) {
    printf("glsl: %s: shaders are not run\n", what);
    exit(77);
}

/* What the linker calls a function, as another pointer than one to data. */
static void load(void *to, const char *name) {
    __eglMustCastToProperFunctionPointerType f = eglGetProcAddress(name);
    if (!f) fprintf(stderr, "glsl: no %s\n", name), exit(1);
    memcpy(to, &f, sizeof f);
}

static void begin(void) {
    static const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, 0, EGL_NONE},
                        version[] = {EGL_CONTEXT_MAJOR_VERSION, 4, EGL_CONTEXT_MINOR_VERSION, 0, EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                     EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
    EGLDisplay display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
    EGLContext context;
    EGLConfig config;
    EGLint count = 0;
    GLuint name;
    if (!eglInitialize(display, NULL, NULL) || !eglBindAPI(EGL_OPENGL_API)) leave("no OpenGL by EGL");
    if (!eglChooseConfig(display, wanted, &config, 1, &count) || !count) leave("no configuration of EGL");
    context = eglCreateContext(display, config, EGL_NO_CONTEXT, version);
    if (context == EGL_NO_CONTEXT || !eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) leave("no context of OpenGL 4.0");
#define LOAD(type, name) load(&gl##name, "gl" #name);
    FUNCTIONS(LOAD)
    glGenTextures(1, &name), glBindTexture(GL_TEXTURE_2D, name);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA32F, WIDTH, WIDTH, 0, GL_RGBA, GL_FLOAT, NULL);
    glGenFramebuffers(1, &name), glBindFramebuffer(GL_FRAMEBUFFER, name);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, name, 0);
    if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) fail("no picture of floats");
    glViewport(0, 0, WIDTH, WIDTH);
}

static GLuint program(const char *path) {
    static const char *const corner = "#version 330 core\n"
                                      "layout(location = 0) in vec3 at;\n"
                                      "layout(location = 1) in vec2 pixel;\n"
                                      "out vec3 grid;\n"
                                      "void main() { grid = at; gl_Position = vec4(pixel, 0.0, 1.0); }\n";
    static char text[8192], said[2048];
    const char *source[2];
    FILE *file = fopen(path, "rb");
    GLuint name = glCreateProgram();
    GLint linked = 0;
    if (!file) fail("a shader cannot be read");
    text[fread(text, 1, sizeof text - 1, file)] = 0, fclose(file);
    source[0] = corner, source[1] = text;
    for (int i = 0; i < 2; i++) {
        GLuint shader = glCreateShader(i ? GL_FRAGMENT_SHADER : GL_VERTEX_SHADER);
        glShaderSource(shader, 1, &source[i], NULL), glCompileShader(shader), glAttachShader(name, shader);
    }
    glLinkProgram(name), glGetProgramiv(name, GL_LINK_STATUS, &linked);
    glGetProgramInfoLog(name, sizeof said, NULL, said);
    if (!linked) fail(said);
    glUseProgram(name);
    return name;
}

/* A volume of texels, as a user would hand it over. */
static void texture(int unit, GLint held, GLenum order, GLenum type, const isogi_trace_desc *d, const void *texels) {
    GLuint name;
    GLsizei size[3];
    glGenTextures(1, &name), glActiveTexture(GL_TEXTURE0 + (GLenum)unit), glBindTexture(GL_TEXTURE_3D, name);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_MIN_FILTER, GL_LINEAR), glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    for (int a = 0; a < 3; a++) {
        static const GLenum wrap[3] = {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T, GL_TEXTURE_WRAP_R};
        glTexParameteri(GL_TEXTURE_3D, wrap[a], GL_CLAMP_TO_EDGE), size[a] = (GLsizei)d->lattice[a];
    }
    glTexImage3D(GL_TEXTURE_3D, 0, held, size[0], size[1], size[2], 0, order, type, texels);
}

static void vector(GLuint p, const char *name, const double x[3]) {
    float v[3] = {(float)x[0], (float)x[1], (float)x[2]};
    glUniform3fv(glGetUniformLocation(p, name), 1, v);
}

/* Each point's colour. */
static void draw(const float (*grid)[3], float (*colour)[4]) {
    static float pixel[COUNT][2];
    GLuint buffer[2];
    glGenVertexArrays(1, buffer), glBindVertexArray(buffer[0]), glGenBuffers(2, buffer);
    for (int i = 0; i < COUNT; i++)
        pixel[i][0] = (2 * (float)(i % WIDTH) + 1) / WIDTH - 1, pixel[i][1] = (2 * (float)(i / WIDTH) + 1) / WIDTH - 1;
    for (GLuint i = 0; i < 2; i++) {
        glBindBuffer(GL_ARRAY_BUFFER, buffer[i]);
        if (i) glBufferData(GL_ARRAY_BUFFER, sizeof pixel, pixel, GL_STATIC_DRAW);
        else glBufferData(GL_ARRAY_BUFFER, COUNT * sizeof *grid, grid, GL_STATIC_DRAW);
        glVertexAttribPointer(i, i ? 2 : 3, GL_FLOAT, GL_FALSE, 0, NULL), glEnableVertexAttribArray(i);
    }
    glClearColor(-1, -1, -1, -1), glClear(GL_COLOR_BUFFER_BIT);
    glDrawArrays(GL_POINTS, 0, COUNT), glReadPixels(0, 0, WIDTH, WIDTH, GL_RGBA, GL_FLOAT, colour);
    if (glGetError() != GL_NO_ERROR) fail("OpenGL tells of an error");
}

/* ---- what is to be seen ---- */

static float grid[COUNT][3], points[COUNT][3], light[COUNT][3], colour[COUNT][4];

static double random_number(void) {
    static uint32_t state = 1;
    state = state * 1664525 + 1013904223;
    return state / 4294967296.0;
}

/* Points of the surface around which all eight texels have light: there export adds nothing, and the hardware's means are those of
   lookups. */
static void choose(const isogi_trace *t, const isogi_trace_desc *d, double isovalue) {
    for (int count = 0; count < COUNT;) {
        isogi_ray ray = {.isovalue = isovalue};
        isogi_hit hit;
        double at[3];
        int valid = 1;
        for (int a = 0; a < 3; a++) {
            ray.origin[a] = (SIDE - 1) * (random_number() * 2 - 0.5);
            ray.dir[a] = (float)(random_number() - 0.5);
        }
        isogi_vol_intersect(d->pyramid, &ray, 1, &hit, NULL);
        if (!hit.side) continue;
        isogi_vol_positions(d->pyramid, &hit, 1, (float(*)[3])points[count]);
        isogi_vol_to_grid(d->pyramid, (double[3]){(double)points[count][0], (double)points[count][1], (double)points[count][2]}, at);
        for (int a = 0; a < 3; a++) {
            grid[count][a] = (float)at[a];
            valid = valid && at[a] > d->lattice_min[a] && at[a] < d->lattice_max[a];
        }
        for (int k = 0; k < 8 && valid; k++) {
            size_t texel[3];
            for (int a = 0; a < 3; a++)
                texel[a] = (size_t)((at[a] - d->lattice_min[a]) / (d->lattice_max[a] - d->lattice_min[a]) * (double)(d->lattice[a] - 1)) +
                           (size_t)(k >> a & 1);
            valid = valid && isogi_trace_valid(t, texel);
        }
        count += valid;
    }
}

/* What is drawn against what was sampled: the largest difference, over the largest light. */
static double difference(const float albedo[3]) {
    double most = 0, largest = 0;
    draw((const float(*)[3])grid, colour);
    for (int i = 0; i < COUNT; i++)
        for (int c = 0; c < 3; c++) {
            double shown = (double)(albedo[c] * (light[i][c] > 0 ? light[i][c] : 0)) / PROCEDURAL_PI;
            most = fmax(most, fabs((double)colour[i][c] - shown)), largest = fmax(largest, shown);
        }
    return most / largest;
}

int main(int argc, char **argv) {
    static const char *const name[5] = {"", "float", "half", "rgb9e5", "byte"};
    /* as isogi_trace_format has it, and as transfer is stored in half anyway; bytes are interpolated in bytes, by llvmpipe */
    static const double most[2][5] = {{0, 1e-5, 5e-4, 2e-3, 1e-2}, {0, 1e-5, 1e-5, 0, 1e-2}};
    static const struct { GLint held; GLenum order, type; } kind[2][5] = {
        {{0, 0, 0}, {GL_RGB32F, GL_RGB, GL_FLOAT}, {GL_RGB16F, GL_RGB, GL_HALF_FLOAT}, {GL_RGB9_E5, GL_RGB, GL_UNSIGNED_INT_5_9_9_9_REV},
         {GL_RGB8, GL_RGB, GL_UNSIGNED_BYTE}},
        {{0, 0, 0}, {GL_RGBA32F, GL_RGBA, GL_FLOAT}, {GL_RGBA16F, GL_RGBA, GL_HALF_FLOAT}, {0, 0, 0}, {GL_RGBA8_SNORM, GL_RGBA, GL_BYTE}}};
    static float sky[4][3];
    static const float albedo[3] = {0.7f, 0.6f, 0.5f};
    const procedural_shape *shape = procedural_find("engine-block");
    isogi_volume volume;
    isogi_pyramid *pyramid = NULL;
    isogi_light sun;
    int failed = 0;
    if (argc != 3) return fprintf(stderr, "usage: glsl IRRADIANCE.frag TRANSFER.frag\n"), 2;
    if (procedural_make(shape, SIDE, &volume, NULL) != ISOGI_OK || isogi_vol_build(&pyramid, &volume, NULL) != ISOGI_OK) fail("no volume");
    begin();
    for (int transfer = 0; transfer < 2; transfer++) {
        isogi_trace_desc d = {.pyramid = pyramid, .samples = 16, .bounces = 1, .mode = (isogi_trace_mode)transfer};
        isogi_trace *t = NULL;
        GLuint p = program(argv[1 + transfer]);
        isogi_lighting lighting = {0};
        float coefficients[2][28][3] = {{{0}}};
        daylight_make(&lighting, sky, &sun);
        sun.radius = 0.3f; /* within what order 5 holds */
        for (int a = 0; a < 3; a++) { /* a part of the volume, and another number of texels along each axis */
            d.lattice_min[a] = 1.5 + a, d.lattice_max[a] = (double)volume.size[a] - 2 - 0.25 * a;
            d.lattice[a] = volume.size[a] / 2 + 9 + 2 * (size_t)a, d.albedo[a] = transfer ? 0.6f : albedo[a];
        }
        d.lighting = lighting;
        if (isogi_trace_create(&t, &d, NULL) != ISOGI_OK || isogi_trace_step(t, 0, NULL) != ISOGI_OK) fail("no light");
        if (transfer && isogi_trace_lighting(t, coefficients[0], coefficients[1]) != ISOGI_OK) fail("no coefficients");
        choose(t, &d, shape->isovalue);
        isogi_trace_sample(t, (const float(*)[3])points, COUNT, light, NULL);
        vector(p, "lattice_min", d.lattice_min), vector(p, "lattice_max", d.lattice_max);
        glUniform3fv(glGetUniformLocation(p, "albedo"), 1, albedo);
        if (transfer) glUniform3fv(glGetUniformLocation(p, "light"), 28, coefficients[0][0]);
        if (transfer) glUniform3fv(glGetUniformLocation(p, "least"), 28, coefficients[1][0]);
        for (int format = ISOGI_TRACE_FLOAT; format <= ISOGI_TRACE_BYTE; format++) {
            static const GLint units[7] = {0, 1, 2, 3, 4, 5, 6};
            size_t bytes = isogi_trace_export_size(t, format);
            uint8_t *texels = bytes ? (uint8_t *)malloc(bytes) : NULL;
            float scale[28] = {0};
            double error;
            if (!kind[transfer][format].held && !bytes) continue; /* not for this mode */
            if (!texels) fail("nothing is exported");
            if (isogi_trace_export(t, format, texels, bytes) != ISOGI_OK || isogi_trace_export_scales(t, format, scale) != ISOGI_OK)
                fail("no export");
            for (int i = 0; i < (transfer ? 7 : 1); i++)
                texture(i, kind[transfer][format].held, kind[transfer][format].order, kind[transfer][format].type, &d,
                        texels + bytes / (transfer ? 7 : 1) * (size_t)i);
            if (transfer) glUniform4fv(glGetUniformLocation(p, "scale"), 7, scale);
            else glUniform3fv(glGetUniformLocation(p, "scale"), 1, scale);
            glUniform1iv(glGetUniformLocation(p, transfer ? "transfer" : "light"), transfer ? 7 : 1, units);
            error = difference(albedo);
            printf("%s, %s: largest difference %.1e of the largest light\n", transfer ? "transfer" : "irradiance", name[format], error);
            failed |= !(error <= most[transfer][format]);
            free(texels);
        }
        isogi_trace_free(t);
    }
    isogi_vol_free(pyramid), procedural_free(&volume);
    return failed;
}
