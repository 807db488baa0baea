/* vnca, Apache-2.0; sources f18666edaa9d2c84a8d9d5159f1991d5bc788476b6b6325180af609a2c1917d2 */
var x=class extends Error{};function le(a){let e=String(a instanceof Error?a.message:a).replace(/\s+/g," ").trim();return e.length>300?`${e.slice(0,300)}…`:e}function k(a,e){if(!a)throw new x(e)}var Ve=["maxBufferSize","maxStorageBufferBindingSize","maxTextureDimension3D","maxTextureDimension2D"],De=65535,V=class a{constructor(e,t,r){this.device=e;this.name=t;this.hasHalf=r;this.lost=e.lost}device;name;hasHalf;lost;modules=new Map;pipelines=new Map;static async open(){if(!("gpu"in navigator))throw new x("This browser has no WebGPU.");let e=await navigator.gpu.requestAdapter({powerPreference:"high-performance"});if(e===null)throw new x("This browser has WebGPU, but finds no GPU that it may use.");let t=e.features.has("shader-f16"),r={};for(let l of Ve)r[l]=e.limits[l];let s=await e.requestDevice({requiredFeatures:t?["shader-f16"]:[],requiredLimits:r}),{vendor:i,architecture:n,description:o}=e.info;return new a(s,o||`${i} ${n}`.trim()||"a GPU",t)}buffer(e,t,r=0){let s=typeof e=="number"?e:e.byteLength,i=Math.min(this.device.limits.maxStorageBufferBindingSize,this.device.limits.maxBufferSize);if(s>i)throw new x(`${t} takes ${D(s)}, and this GPU binds at most ${D(i)}: choose a smaller sequence or less detail.`);let n=this.device.createBuffer({size:Math.max(16,Math.ceil(s/4)*4),usage:GPUBufferUsage.STORAGE|GPUBufferUsage.COPY_DST|GPUBufferUsage.COPY_SRC|r});return typeof e!="number"&&this.write(n,e),n}uniform(e){let t=GPUBufferUsage.UNIFORM|GPUBufferUsage.COPY_DST;return this.device.createBuffer({size:e,usage:t})}write(e,t,r=0){this.device.queue.writeBuffer(e,r,t.buffer,t.byteOffset,t.byteLength)}module(e){let t=this.modules.get(e);return t===void 0&&(t=this.device.createShaderModule({code:e}),this.modules.set(e,t)),t}compute(e,t){let r=`${t}
${e}`,s=this.pipelines.get(r);if(s===void 0){let i={module:this.module(e),entryPoint:t};s=this.device.createComputePipelineAsync({layout:"auto",compute:i}),this.pipelines.set(r,s)}return s}render(e,t,r){let s=this.module(e);return this.device.createRenderPipelineAsync({layout:"auto",vertex:{module:s,entryPoint:"corner"},fragment:{module:s,entryPoint:t,targets:[{format:r}]}})}bound(e,t,r){let s=Object.entries(r).map(([i,n])=>({binding:Number(i),resource:n instanceof GPUBuffer?{buffer:n}:n}));return this.device.createBindGroup({layout:e.getBindGroupLayout(t),entries:s})}submit(e){let t=this.device.createCommandEncoder();e(t),this.device.queue.submit([t.finish()])}async read(e,t=e.size){let r=GPUBufferUsage.COPY_DST|GPUBufferUsage.MAP_READ,s=this.device.createBuffer({size:t,usage:r});this.submit(n=>n.copyBufferToBuffer(e,0,s,0,t)),await s.mapAsync(GPUMapMode.READ);let i=s.getMappedRange().slice(0);return s.destroy(),i}async pixels(e,t){let{width:r,height:s}=e,i=r*t,n=Math.ceil(i/256)*256,o=GPUBufferUsage.COPY_DST|GPUBufferUsage.MAP_READ,l=this.device.createBuffer({size:n*s,usage:o});this.submit(h=>h.copyTextureToBuffer({texture:e},{buffer:l,bytesPerRow:n},{width:r,height:s})),await l.mapAsync(GPUMapMode.READ);let u=new Uint8Array(l.getMappedRange()),c=new Uint8Array(i*s);for(let h=0;h<s;h++)c.set(u.subarray(h*n,h*n+i),h*i);return l.destroy(),c.buffer}};function A(a,e,t,r){let s=a.beginComputePass();if(s.setPipeline(e),t.forEach((i,n)=>s.setBindGroup(n,i)),typeof r=="number"){let i=Math.ceil(r/De)||1;s.dispatchWorkgroups(Math.ceil(r/i),i)}else s.dispatchWorkgroups(...r);s.end()}function D(a){return`${Math.ceil(a/2**20)} MiB`}var We=3,He=64*2**20,F={channels:64,hidden:1024,units:256,dilation:64,steps:4096},ue={position:3,density:1,velocity:3},qe=["first","second","third","output"];function Q(a,e){try{return Ye(a,e)}catch(t){throw t instanceof x?t:new x(`${e}: damaged model (${t.message})`)}}function Ye(a,e){let t=(g,w)=>k(g,`${e}: ${w}`);t(a.byteLength>=8,"not a model of vnca"),t(a.byteLength<=He,"larger than any model of vnca");let r=Number(new DataView(a).getBigUint64(0,!0));t(r<=a.byteLength-8,"not a model of vnca");let s=ce(new TextDecoder().decode(new Uint8Array(a,8,r)),e),i=s?.__metadata__?.vnca;t(typeof i=="string","not a model of vnca");let n=ce(i,e);t(Number.isInteger(n.format_version)&&n.format_version>=1,"damaged model"),t(n.format_version<=We,`its format, ${n.format_version}, is newer than this page`);let o=n.rule,l=g=>je(a,8+r,s[g],`${e}: ${g}`),u=(g,w,U,T)=>(t(typeof g=="number"&&g>=w&&g<=U,`${T}: ${String(g)}`),g),c=u(o.channels,4,F.channels,"channels"),h=u(o.hidden,1,F.hidden,"hidden"),f=n.conditioning??Object.entries(ue).map(([g,w])=>[g,w]);t(Array.isArray(f),"damaged model");let d={},p=0;for(let[g,w]of f){let U=typeof g=="string"&&ue[g]===w;t(U,`the rule is conditioned on ${String(g)}, which this page does not have`),o[`${g}_prior`]!==!1&&(d[g]=p),p+=w}let m=$(l("hidden"),h,5*c+p,`${e}: hidden`),y=$(l("bias"),h,1,`${e}: bias`),P=$(l("output"),c,h,`${e}: output`),{density:v,velocity:S,gamma:b}=n.scales;for(let g of[v,S,b])u(g,1e-30,1e30,"scale");return{name:e,title:String(n.training?.title??n.training?.style??""),channels:c,hidden:m,bias:y,output:P,decoder:Ke(s,l,c,e),probability:u(o.update_probability,1e-9,1,"update_probability"),steps:u(o.steps_per_frame,1,F.steps,"steps_per_frame"),dilation:u(o.dilation??o.reach??1,0,F.dilation,"dilation"),wholeBox:o.domain==="box",sobel:u(o.sobel_divisor,1e-9,1e9,"sobel_divisor"),laplacian:u(o.laplacian_divisor,1e-9,1e9,"laplacian_divisor"),columns:d,width:p,density:v,speed:S,gamma:b,place:Xe(n.place,e)}}function ce(a,e){try{return JSON.parse(a)}catch{throw new x(`${e}: not a model of vnca`)}}function je(a,e,t,r){k(t!==void 0,`${r} is missing`),k(t.dtype==="F32",`${r}: expected F32, got ${String(t.dtype)}`);let[s,i=1]=t.shape,[n,o]=t.data_offsets,l=o-n===4*s*i&&n>=0&&e+o<=a.byteLength;k(l&&t.shape.length<=2,`${r}: its place in the file cannot be`);let u=new Float32Array(a.slice(e+n,e+o));return k(u.every(Number.isFinite),`${r}: not all finite`),{values:u,rows:s,columns:i}}function $(a,e,t,r){let s=a.rows===e&&a.columns===t;return k(s,`${r}: expected ${e} × ${t}, got ${a.rows} × ${a.columns}`),a}function Ke(a,e,t,r){if(a["decoder.first"]===void 0)return[];let i=e("decoder.first").rows;return k(i>=1&&i<=F.units,`${r}: a decoder of ${i} units`),qe.map((n,o)=>{let l=n==="output"?4:i,u=`${r}: decoder.${n}`;return{weights:$(e(`decoder.${n}`),l,o===0?t:i,u),bias:$(e(`decoder.${n}_bias`),l,1,`${u}_bias`)}})}function Xe(a,e){if(a==null)return null;let t=a.lattice_to_world,[r,s]=a.box,i=[...t.flat(),...r,...s],n=i.length===22&&i.every(o=>Number.isFinite(o)&&Math.abs(o)<1e30);return k(n&&r.every((o,l)=>o<s[l]),`${e}: its place cannot be`),{toWorld:t,lower:r,upper:s}}var Je="vncasmk1",Qe=65536,Ze=2**24,et=1e5,tt=2**20,rt=64*2**20,W=class a{constructor(e,t,r,s,i,n,o,l,u,c){this.url=e;this.name=t;this.fps=r;this.lower=s;this.upper=i;this.toWorld=n;this.density=o;this.speed=l;this.stored=u;this.begin=c}url;name;fps;lower;upper;toWorld;density;speed;stored;begin;frames=new Map;whole=null;get length(){return this.stored.length}number(e){return this.stored[e].number}static async open(e){let t=e.split("/").pop()??e,{bytes:r,isWhole:s}=await Z(e,0,Qe);k(r.length>=12,`${t}: not a sequence of vnca`);let i=String.fromCharCode(...r.subarray(0,8));k(i===Je,`${t}: not a sequence of vnca`);let n=new DataView(r.buffer,r.byteOffset).getUint32(8,!0);k(n<=Ze,`${t}: its header is damaged`),r.length<12+n&&!s&&({bytes:r,isWhole:s}=await Z(e,0,12+n)),k(r.length>=12+n,`${t}: it ends within its header`);let o;try{let l=new TextDecoder().decode(r.subarray(12,12+n));o=a.described(e,t,JSON.parse(l),12+n)}catch(l){throw l instanceof x?l:new x(`${t}: its header is damaged (${le(l)})`)}return s&&(o.whole=r),o}static described(e,t,r,s){let i=(m,y)=>k(m,`${t}: its header is damaged (${y})`),[n,o]=r.box,l=[...n,...o].every(Number.isInteger)&&n.length===3;i(l&&n.every((m,y)=>m<o[y]),"box");let{density:u,speed:c,fps:h}=r;i(u>0&&u<1e30&&c>=0&&c<1e30,"scales"),i(h>0&&h<=1e3,"fps");let f=r.lattice_to_world;i(f.flat().length===16&&f.flat().every(Number.isFinite),"lattice_to_world");let d=r.frames;i(Array.isArray(d)&&d.length>=1&&d.length<=et,"frames");for(let{number:m,offset:y,length:P,bricks:v}of d){let S=[y,P,v].every(b=>Number.isInteger(b)&&b>=0);i(S&&Number.isInteger(m)&&v<=tt,"frames")}let p=String(r.name??t).slice(0,100);return new a(e,p,h,n,o,f,u,c,d,s)}frame(e){let t=this.frames.get(e);return t===void 0&&(t=this.read(this.stored[e]),this.frames.set(e,t),t.catch(()=>this.frames.delete(e)),this.forget()),t}forget(){let e=0;for(let t of[...this.frames.keys()].reverse())e+=this.stored[t].bricks*2048,e>rt&&this.frames.delete(t)}async read(e){let{number:t,offset:r,length:s,bricks:i}=e,n=`${this.name}, frame ${t}`,o;if(this.whole===null){let{bytes:p,isWhole:m}=await Z(this.url,this.begin+r,s);m&&(this.whole=p),o=m?p.subarray(this.begin+r,this.begin+r+s):p}else o=this.whole.subarray(this.begin+r,this.begin+r+s);k(o.length===s,`${n}: the file ends before it`);let l=i*(6+512*(this.speed>0?4:1)),u=await st(o,l,n),c=this.lower.map(p=>Math.floor(p/8)),h=this.upper.map(p=>Math.floor((p-1)/8)),f=new DataView(u.buffer),d=new Int32Array(3*i);for(let p=0;p<d.length;p++)d[p]=f.getUint16(2*p,!0)+c[p%3],k(d[p]<=h[p%3],`${n}: a brick lies outside the box`);return{number:t,count:i,bricks:d,planes:u.slice(6*i)}}};async function Z(a,e,t){let r=`bytes=${e}-${e+Math.max(t,1)-1}`,s=await fetch(a,{headers:{Range:r}});if(s.status!==206&&s.status!==200)throw new x(`${a.split("/").pop()}: the server says ${s.status}`);return{bytes:new Uint8Array(await s.arrayBuffer()),isWhole:s.status===200}}async function st(a,e,t){let r=new Uint8Array(e),i=new Blob([a]).stream().pipeThrough(new DecompressionStream("deflate")).getReader(),n=0;try{for(;;){let{done:o,value:l}=await i.read();if(o)break;k(n+l.length<=e,`${t}: more than it says`),r.set(l,n),n+=l.length}}catch(o){throw i.cancel().catch(()=>{}),o instanceof x?o:new x(`${t}: damaged`)}return k(n===e,`${t}: less than it says`),r}var ee=`// What a finger does: to the smoke that it points at, erase the state or change the mix of rules.

struct Brush {
  eye: vec4f,       // Of the ray, in cells; w: the radius, cells.
  way: vec4f,       // A unit vector; w: γ of a cell of density 1.
  size: vec4f,      // Of what is drawn, in its cells; w: parts of a cell.
  amount: f32,      // What is added to the mix.
}

@group(1) @binding(0) var<uniform> brush: Brush;
@group(1) @binding(1) var drawn: texture_3d<f32>;
@group(1) @binding(2) var<storage, read_write> hit: vec4f;           // The cell met; w: 1 if any.
@group(1) @binding(3) var<storage, read_write> state: array<vec4f>;
@group(1) @binding(4) var<storage, read_write> brushed: array<f32>;

// Where half of the light is gone.
@compute @workgroup_size(1)
fn meet() {
  var reached = 0.0;
  hit = vec4f(0.0);
  let way = brush.way.xyz;
  let a = (vec3f(-0.5) - brush.eye.xyz) / way;
  let b = (brush.size.xyz - 0.5 - brush.eye.xyz) / way;
  let near = max(max(min(a.x, b.x), max(min(a.y, b.y), min(a.z, b.z))), 0.0);
  let far = min(max(a.x, b.x), min(max(a.y, b.y), max(a.z, b.z)));
  for (var depth = near; depth <= far; depth += 0.5) {
    let cell = brush.eye.xyz + depth * way;
    let at = clamp(vec3i(floor(cell + 0.5)), vec3i(0), vec3i(brush.size.xyz) - 1);
    reached += 0.5 * brush.way.w * textureLoad(drawn, at, 0).w;
    if (reached > 0.7) {
      hit = vec4f((cell - 0.5) / brush.size.w - 0.5, 1.0);
      return;
    }
  }
}

fn is_near(cell: vec3i) -> bool {
  return hit.w > 0.0 && distance(vec3f(cell), hit.xyz + vec3f(smoke.lower)) <= brush.eye.w;
}

@compute @workgroup_size(64)
fn erase(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let row = thread.y * groups.x * 64u + thread.x;
  if (row < sites.cells && is_near(cell_of(row))) {
    for (var p = 0u; p < PLANES; p++) {
      state[row * PLANES + p] = vec4f(0.0);
    }
  }
}

@compute @workgroup_size(4, 4, 4)
fn blend(@builtin(global_invocation_id) thread: vec3u) {
  let side = smoke.upper - smoke.lower;
  let at = vec3i(thread);
  if (any(at >= side) || !is_near(at + smoke.lower)) {
    return;
  }
  let number = u32((at.x * side.y + at.y) * side.z + at.z);
  brushed[number] = clamp(brushed[number] + brush.amount, -1.0, 1.0);
}
`;var fe=`// The picture on the screen: in front of the soft background of films, as sRGB.

struct Screen {
  background: vec4f,  // Linear; w: 1 where it is soft.
  exposure: f32,      // What light is multiplied by.
  wipe: f32,          // Where the line between two halves stands, 0 … 1; 2: none.
  size: vec2f,        // Pixels.
}

@group(0) @binding(0) var<uniform> screen: Screen;
@group(0) @binding(1) var picture: texture_2d<f32>;
@group(0) @binding(2) var between: sampler;

fn srgb(linear: vec3f) -> vec3f {
  let value = clamp(linear, vec3f(0.0), vec3f(1.0));
  return select(1.055 * pow(value, vec3f(1.0 / 2.4)) - 0.055, 12.92 * value, value <= vec3f(0.0031308));
}

@vertex
fn corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
  return vec4f(vec2f(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0, 0.0, 1.0);
}

@fragment
fn present(@builtin(position) at: vec4f) -> @location(0) vec4f {
  let place = at.xy / screen.size;
  let seen = textureSampleLevel(picture, between, place, 0.0);
  var behind = screen.background.xyz;
  if (screen.background.w > 0.0) {
    let away = 2.0 * place - 1.0;
    let weight = cos(3.14159265 * min(sqrt(dot(away, away) / 2.0), 1.0));
    behind *= 1.0 + weight * select(vec3f(0.4), 0.8 * (1.0 - behind), weight > 0.0);
    let noise = fract(52.9829189 * fract(0.06711056 * floor(at.x) + 0.00583715 * floor(at.y))) - 0.5;
    let dithered = clamp(srgb(behind) + noise / 255.0, vec3f(0.0), vec3f(1.0));
    behind = select(
      pow((dithered + 0.055) / 1.055, vec3f(2.4)), dithered / 12.92, dithered <= vec3f(0.04045)
    );
  }
  var colour = srgb(screen.exposure * seen.xyz + (1.0 - seen.w) * behind);
  if (abs(at.x - screen.wipe * screen.size.x) < 1.0) {
    colour = mix(colour, vec3f(1.0), 0.5);
  }
  return vec4f(colour, 1.0);
}
`;var L=`// The smoke of a frame as its file has it: bytes of bricks, made into numbers where they are read.

struct Smoke {
  lower: vec3i,     // Of the box, its lowest cell,
  density: f32,     // what the greatest byte stands for,
  upper: vec3i,     // one beyond its highest,
  speed: f32,       // and of a component of velocity; 0 without velocity.
  first: vec3i,     // The lowest brick of the map, in bricks,
  bricks: u32,      // how many bricks there are,
  span: vec3i,      // and how many the map has along each axis.
  unused: u32,
}

// The map, the number of a brick or NONE; then the densities, 128 words a brick; then the velocities.
@group(2) @binding(0) var<uniform> smoke: Smoke;
@group(2) @binding(1) var<storage, read> bytes: array<u32>;

const NONE = 0xffffffffu;

// Where a cell stands among those of all bricks, or NONE.
fn stored_at(cell: vec3i) -> u32 {
  let at = (cell >> vec3u(3)) - smoke.first;
  if (any(at < vec3i(0)) || any(at >= smoke.span)) {
    return NONE;
  }
  let brick = bytes[u32((at.x * smoke.span.y + at.y) * smoke.span.z + at.z)];
  let within = vec3u(cell & vec3i(7));
  return select(512u * brick + ((within.x << 6) | (within.y << 3) | within.z), NONE, brick == NONE);
}

fn byte_of(plane: u32, stored: u32) -> u32 {
  let map = u32(smoke.span.x * smoke.span.y * smoke.span.z);
  let word = bytes[map + 128u * plane * smoke.bricks + stored / 4u];
  return (word >> (8u * (stored & 3u))) & 255u;
}

fn density_at(cell: vec3i) -> f32 {
  let stored = stored_at(cell);
  if (stored == NONE) {
    return 0.0;
  }
  let part = f32(byte_of(0u, stored)) / 255.0;
  return smoke.density * part * part;
}

fn velocity_at(cell: vec3i) -> vec3f {
  let stored = stored_at(cell);
  if (stored == NONE || smoke.speed == 0.0) {
    return vec3f(0.0);
  }
  var parts: vec3f;
  for (var axis = 0u; axis < 3u; axis++) {
    let byte = i32(byte_of(axis + 1u, stored) << 24u) >> 24u;
    parts[axis] = f32(byte) / 127.0;
  }
  return smoke.speed * parts * abs(parts);
}
`;var N=`// Where cells lie: rows of the state by index coordinates, through a map of bricks of 8³ cells.
//
// The places around a cell are looked up, never listed: a list of 27 rows a cell would be larger
// than all else that there is.

struct Sites {
  lower: vec3i,     // Of the box, beyond which neighbours are repeated or wrapped: its lowest cell,
  cells: u32,       // how many cells are active,
  upper: vec3i,     // and one beyond its highest.
  circular: u32,    // 1 where neighbours are wrapped.
  first: vec3i,     // The lowest brick of the map, in bricks,
  bricks: u32,      // how many bricks hold cells,
  span: vec3i,      // and how many the map has along each axis.
  unused: u32,
}

const NOWHERE = 0xffffffffu;

// Rows from \`cells\` on belong to cells beside the active ones, which have a place and no state.
//
// Behind each other: the map, a number of a brick or NOWHERE for each of its places, z fastest; the
// coordinates of the bricks, three each; the rows of their cells, 512 each; and where the cell of
// each row lies, number of brick · 512 + place in it.
@group(0) @binding(0) var<uniform> sites: Sites;
@group(0) @binding(1) var<storage, read> places: array<u32>;

fn map_length() -> u32 {
  return u32(sites.span.x * sites.span.y * sites.span.z);
}

// The number of the brick that holds a cell, or NOWHERE.
fn brick_at(cell: vec3i) -> u32 {
  let at = (cell >> vec3u(3)) - sites.first;
  if (any(at < vec3i(0)) || any(at >= sites.span)) {
    return NOWHERE;
  }
  return places[u32((at.x * sites.span.y + at.y) * sites.span.z + at.z)];
}

fn place_in_brick(cell: vec3i) -> u32 {
  let within = vec3u(cell & vec3i(7));
  return (within.x << 6) | (within.y << 3) | within.z;
}

// The row of a cell, or NOWHERE.
fn row_of(cell: vec3i) -> u32 {
  let brick = brick_at(cell);
  if (brick == NOWHERE) {
    return NOWHERE;
  }
  return places[map_length() + 3u * sites.bricks + 512u * brick + place_in_brick(cell)];
}

// The cell that stands for a place at most a box beside the box.
fn bordered(cell: vec3i) -> vec3i {
  if (sites.circular == 1u) {
    let size = sites.upper - sites.lower;
    return (cell - sites.lower + size) % size + sites.lower;
  }
  return clamp(cell, sites.lower, sites.upper - 1);
}

fn cell_of(row: u32) -> vec3i {
  let at = places[map_length() + 515u * sites.bricks + row];
  let brick = map_length() + 3u * (at >> 9);
  let corner = vec3i(vec3u(places[brick], places[brick + 1u], places[brick + 2u]));
  return corner * 8 + vec3i(vec3u((at >> 6) & 7u, (at >> 3) & 7u, at & 7u));
}
`;function z(a){return Math.ceil(a/4)}function he(a){let e=a;return e^=e>>>16,e=Math.imul(e,2146121005),e^=e>>>15,e=Math.imul(e,2221713035),e^=e>>>16,e>>>0}function pe(a,e){return he((a>>>0)+he(e>>>0)>>>0)}function me(a){return Math.min(Math.max(Math.round(a*2**32),1),2**32-1)}function be(a,e){let t=new Float32Array(216),r=[1,2,1];for(let s=0;s<27;s++){let[i,n,o]=[Math.floor(s/9),Math.floor(s/3)%3,s%3],l=Math.abs(i-1)+Math.abs(n-1)+Math.abs(o-1);t.set([l===0?1:0,(i-1)*r[n]*r[o]/a,(n-1)*r[i]*r[o]/a,(o-1)*r[i]*r[n]/a,[-88,6,3,2][l]/e],8*s)}return t}function ge(a,e,t){let{channels:r,hidden:s,bias:i,output:n}=a,o=4*z(r),l=5*o+e+o,u=new Float32Array(s.rows*l);for(let c=0;c<s.rows;c++){let h=s.values.subarray(c*s.columns,(c+1)*s.columns),f=c*l;for(let d=0;d<5;d++){let p=h.subarray(d*r,(d+1)*r);u.set(p,f+d*o)}u.set(h.subarray(5*r),f+5*o),u[f+5*o+e-1]=i.values[c];for(let d=0;d<r;d++){let p=f+5*o+e+d;u[p]=n.values[d*n.columns+c]}}return t?lt(u):u}function ye(a){if(a.decoder.length===0)return new Float32Array(4);let e=4*z(a.decoder[0].weights.rows),t=a.decoder.flatMap(({weights:i,bias:n},o)=>{let l=o<3?e:4;return[de(i,l,4*z(i.columns)),de(n,l,1)]}),r=new Float32Array(t.reduce((i,n)=>i+n.length,0)),s=0;for(let i of t)r.set(i,s),s+=i.length;return r}function de(a,e,t){let r=new Float32Array(e*t);for(let s=0;s<a.rows;s++){let i=a.values.subarray(s*a.columns,(s+1)*a.columns);r.set(i,s*t)}return r}function lt(a){let e=new Uint32Array(a.slice().buffer);return Uint16Array.from(e,t=>{let r=t>>>16&32768,s=t&2147483647;if(s>=1199570944)return r|31744;if(s<855638016)return r;if(s<947912704){let o=126-(s>>>23),l=s&8388607|8388608,u=l>>>o,c=l&(1<<o)-1,h=1<<o-1;return r|u+(c>h||c===h&&u&1?1:0)}let i=s-939524096>>>13,n=s&8191;return r|i+(n>4096||n===4096&&i&1?1:0)})}function we(a,e){return a.map(t=>[0,1,2,3].map(r=>t.reduce((s,i,n)=>s+i*e[n][r],0)))}function te(a,e){return[0,1,2].map(t=>H(a[t],e)+a[t][3])}function ve(a,e){return[0,1,2].map(t=>H(a[t],e))}function H(a,e){return a[0]*e[0]+a[1]*e[1]+a[2]*e[2]}function I(a){let[e,t,r]=a.map(u=>u.slice(0,3)),s=(u,c)=>[u[1]*c[2]-u[2]*c[1],u[2]*c[0]-u[0]*c[2],u[0]*c[1]-u[1]*c[0]],i=[s(t,r),s(r,e),s(e,t)],n=H(e,i[0]),o=[0,1,2].map(u=>i.map(c=>c[u]/n)),l=[a[0][3],a[1][3],a[2][3]];return[...o.map(u=>[...u,-H(u,l)]),[0,0,0,1]]}function E(a,e,t=1){return a.map((r,s)=>r+t*e[s])}function _(a,e){return a.map(t=>t*e)}function xe(a,e){return a.reduce((t,r,s)=>t+r*e[s],0)}var re=Math.PI/180,ut=.04;function B(a,e){let[t,r]=[a*re,e*re],s=[Math.cos(t),Math.sin(t),0],i=[-Math.sin(t),Math.cos(t),0],n=[0,0,1],o=E(_(i,Math.sin(r)),n,Math.cos(r)),l=E(_(i,Math.cos(r)),n,-Math.sin(r));return[s,o,l]}function C(a){return Math.tan(a*re/2)}function q(a){let[,,e]=B(a.azimuth,a.elevation);return E(a.target,e,-a.distance)}function Pe(a,e,t,r,s,i){let n=B(t,r),o=_(E(a,e),.5),l=Array.from({length:8},(P,v)=>E([0,1,2].map(S=>(v>>S&1?e:a)[S]),o,-1)),[u,c,h]=n.map(P=>l.map(v=>xe(v,P))),f=(1-2*ut)*C(i),[d,p]=ke(u,h,f*s),[m,y]=ke(c,h,f);return{target:E(E(o,n[0],d),n[1],m),azimuth:t,elevation:r,distance:Math.max(p,y),fieldOfView:i}}function ke(a,e,t){let r=Math.max(...a.map((i,n)=>i-t*e[n])),s=Math.max(...a.map((i,n)=>-i-t*e[n]));return[(r-s)/2,(r+s)/(2*t)]}var Se=`// The state on the cells of another frame: cells active in both keep theirs, new ones start at zero.

@group(0) @binding(0) var<storage, read> former: array<u32>;  // The row each had, or 0xffffffff.
@group(0) @binding(1) var<storage, read> before: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> after: array<vec4f>;

@compute @workgroup_size(64)
fn carry(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let row = thread.y * groups.x * 64u + thread.x;
  if (row >= arrayLength(&former)) {
    return;
  }
  let had = former[row];
  for (var p = 0u; p < PLANES; p++) {
    var value = vec4f(0.0);
    if (had != 0xffffffffu) {
      value = before[had * PLANES + p];
    }
    after[row * PLANES + p] = value;
  }
}
`;var Ue=`// What the cells of a rule are conditioned on: position, density, velocity, as \`rule/conditioning.py\`.

struct Condition {
  place: mat4x4f,   // From index coordinates to −1 … 1 in the box of the training.
  columns: vec3i,   // The first column of position, density and velocity; −1 where there is none.
  width: u32,       // Numbers a cell is told, the 1 included.
  scales: vec2f,    // Density and speed that count as 1.
  unused: vec2f,
  guide: vec4f,     // A direction, in which velocity is turned by a part.
}

@group(1) @binding(0) var<uniform> given: Condition;
@group(1) @binding(1) var<storage, read_write> told: array<f32>;

const SPEED_LIMIT = 2.0;
const DENSITY_LIMIT = 4.0;

@compute @workgroup_size(64)
fn condition(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let row = thread.y * groups.x * 64u + thread.x;
  if (row >= sites.cells) {
    return;
  }
  let cell = cell_of(row);
  let first = row * given.width;
  for (var k = 0u; k + 1u < given.width; k++) {
    told[first + k] = 0.0;
  }
  told[first + given.width - 1u] = 1.0;
  if (given.columns.x >= 0) {
    let at = clamp((given.place * vec4f(vec3f(cell), 1.0)).xyz, vec3f(-1.0), vec3f(1.0));
    for (var axis = 0u; axis < 3u; axis++) {
      told[first + u32(given.columns.x) + axis] = at[axis];
    }
  }
  if (given.columns.y >= 0) {
    told[first + u32(given.columns.y)] = min(density_at(cell) / given.scales.x, DENSITY_LIMIT);
  }
  if (given.columns.z >= 0) {
    let own = velocity_at(cell) / given.scales.y;
    let turned = mix(own, given.guide.xyz * max(length(own), 0.5), given.guide.w);
    let limited = turned * (SPEED_LIMIT / max(length(turned), SPEED_LIMIT));
    for (var axis = 0u; axis < 3u; axis++) {
      told[first + u32(given.columns.z) + axis] = limited[axis];
    }
  }
}
`;var Ae=`// What is seen of a state: the mean over each part of a cell, as \`painting/__init__.py\` paints it.

struct Paint {
  parts: u32,       // Of a cell along each axis.
  samples: u32,     // Points along each axis of a part.
  layer: u32,       // Of the rim: how far outwards it is.
  cells: u32,       // How many cells are painted: the active ones, or those of the rim.
  margin: i32,      // How far beyond the box of the smoke cells are active: nothing is seen there.
}

@group(2) @binding(0) var<uniform> now: Paint;
@group(2) @binding(1) var<storage, read> state: array<vec4f>;
// By row and part: linear colour, and the factor of density. Of the rim, rows that follow the active
// ones: minus the layer in which its colour was found, or 0.
@group(2) @binding(2) var<storage, read_write> painted: array<vec4f>;

fn linear_of(colour: vec3f) -> vec3f {
  let shown = clamp(colour + 0.5, vec3f(0.0), vec3f(1.0));
  return select(pow((shown + 0.055) / 1.055, vec3f(2.4)), shown / 12.92, shown <= vec3f(0.04045));
}

fn part_of(number: u32) -> vec3u {
  return vec3u(number / (now.parts * now.parts), (number / now.parts) % now.parts, number % now.parts);
}

// The state between the cells around a place \`twice / (2 · along)\` cells from the centre of one.
fn seen_at(cell: vec3i, twice: vec3i, along: i32) -> vec4f {
  let lower = select(vec3i(0), vec3i(-1), twice < vec3i(0));
  let fraction = vec3f(twice) / f32(2 * along) - vec3f(lower);
  var between: array<vec4f, PLANES>;
  for (var corner = 0u; corner < 8u; corner++) {
    let step = vec3i(vec3u(corner >> 2u, (corner >> 1u) & 1u, corner & 1u));
    let row = row_of(bordered(cell + lower + step));
    if (row >= sites.cells) {
      continue;
    }
    let share = select(1.0 - fraction, fraction, step == vec3i(1));
    for (var p = 0u; p < PLANES; p++) {
      between[p] += share.x * share.y * share.z * state[row * PLANES + p];
    }
  }
  return seen_of(between);
}

@compute @workgroup_size(64)
fn paint(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let number = thread.y * groups.x * 64u + thread.x;
  let parts = now.parts * now.parts * now.parts;
  if (number >= now.cells * parts) {
    return;
  }
  let row = number / parts;
  let cell = cell_of(row);
  let part = part_of(number % parts);
  let along = i32(now.parts * now.samples);
  var sum = vec4f(0.0);
  let count = now.samples * now.samples * now.samples;
  for (var s = 0u; s < count; s++) {
    let sample = vec3u(s / (now.samples * now.samples), (s / now.samples) % now.samples, s % now.samples);
    var seen: vec4f;
    if (UNITS4 == 0u) {
      seen = state[row * PLANES];
    } else {
      seen = seen_at(cell, 2 * vec3i(part * now.samples + sample) + 1 - along, along);
    }
    sum += vec4f(linear_of(seen.xyz), 1.0 + clamp(seen.w, -0.5, 0.5));
  }
  painted[number] = sum / f32(count);
}

// A layer of the rim: the mean of those of the six parts beside each that were known a layer before.
@compute @workgroup_size(64)
fn rim(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let parts = now.parts * now.parts * now.parts;
  let number = thread.y * groups.x * 64u + thread.x;
  if (number >= now.cells * parts) {
    return;
  }
  let row = sites.cells + number / parts;
  let at = row * parts + number % parts;
  if (now.layer == 0u) {
    painted[at] = vec4f(1.0, 1.0, 1.0, 0.0);
    return;
  }
  if (painted[at].w != 0.0) {
    return;
  }
  let size = i32(now.parts);
  let fine = cell_of(row) * size + vec3i(part_of(number % parts));
  var sum = vec4f(0.0);
  for (var way = 0u; way < 6u; way++) {
    var beside = fine;
    beside[way / 2u] += i32(way & 1u) * 2 - 1;
    let coarse = vec3i(floor((vec3f(beside) + 0.5) / f32(size)));
    let there = row_of(coarse);
    let inside_box = all(coarse >= sites.lower + now.margin) && all(coarse < sites.upper - now.margin);
    if (there == NOWHERE || !inside_box) {
      continue;
    }
    let inside = vec3u(beside - coarse * size);
    let colour = painted[there * parts + (inside.x * now.parts + inside.y) * now.parts + inside.z];
    let known = -colour.w;
    if (known < 0.0 || (known > 0.0 && known < f32(now.layer))) {
      sum += vec4f(colour.xyz, 1.0);
    }
  }
  if (sum.w > 0.0) {
    painted[at] = vec4f(sum.xyz / sum.w, -f32(now.layer));
  }
}
`;var _e=`// What is seen of a state between cells: its first four channels and what three sine layers add.
//
// out = s[:4] + W4 h3 + b4, h_k = sin(W_k h_(k-1) + b_k), h_0 = s; see \`engine/DECODE.md\`. UNITS4 is a
// quarter of the units of a layer. Behind each other lie, as vectors of four: W1, b1, W2, b2, W3, b3,
// W4, b4. With UNITS4 0 there is no decoder.

@group(1) @binding(0) var<storage, read> decoder: array<vec4f>;

// sin: the languages promise no more than three digits of it, and only near zero. Reduced by
// multiples of π in two parts, then a polynomial: 2e-7 up to arguments of some thousands.
fn sine(angle: vec4f) -> vec4f {
  let turns = round(angle * 0.318309886);
  let rest = (angle - turns * 3.140625) - turns * 9.67653589793e-4;
  let square = rest * rest;
  let series = 1.0 + square * (-1.66666667e-1 + square * (8.33333310e-3
    + square * (-1.98408744e-4 + square * (2.75255616e-6 - square * 2.38843770e-8))));
  let even = 1.0 - 2.0 * abs(turns - 2.0 * floor(0.5 * turns));
  return rest * series * even;
}

fn seen_of(between: array<vec4f, PLANES>) -> vec4f {
  if (UNITS4 == 0u) {
    return between[0];
  }
  var state = between;
  var below: array<vec4f, max(UNITS4, 1u)>;
  var above: array<vec4f, max(UNITS4, 1u)>;
  var at = 0u;
  for (var unit = 0u; unit < UNITS4; unit++) {
    var sum = decoder[4u * UNITS4 * PLANES + unit];
    for (var p = 0u; p < PLANES; p++) {
      let start = 4u * unit * PLANES + p;
      let values = state[p];
      sum += vec4f(
        dot(values, decoder[start]), dot(values, decoder[start + PLANES]),
        dot(values, decoder[start + 2u * PLANES]), dot(values, decoder[start + 3u * PLANES]),
      );
    }
    below[unit] = sine(sum);
  }
  at = 4u * UNITS4 * PLANES + UNITS4;
  for (var layer = 0u; layer < 2u; layer++) {
    for (var unit = 0u; unit < UNITS4; unit++) {
      var sum = decoder[at + 4u * UNITS4 * UNITS4 + unit];
      for (var k = 0u; k < UNITS4; k++) {
        let start = at + 4u * unit * UNITS4 + k;
        let values = below[k];
        sum += vec4f(
          dot(values, decoder[start]), dot(values, decoder[start + UNITS4]),
          dot(values, decoder[start + 2u * UNITS4]), dot(values, decoder[start + 3u * UNITS4]),
        );
      }
      above[unit] = sine(sum);
    }
    below = above;
    at += 4u * UNITS4 * UNITS4 + UNITS4;
  }
  var result = state[0] + decoder[at + 4u * UNITS4];
  for (var k = 0u; k < UNITS4; k++) {
    let values = below[k];
    result += vec4f(
      dot(values, decoder[at + k]), dot(values, decoder[at + UNITS4 + k]),
      dot(values, decoder[at + 2u * UNITS4 + k]), dot(values, decoder[at + 3u * UNITS4 + k]),
    );
  }
  return result;
}
`;var Te=`// One step: s' = s + m · W2 relu(W1 [perception ‖ priors ‖ 1]), the bias being W1's last column.
//
// A row of the state is PLANES vectors of four channels; of what cells are told, TOLD vectors, whose
// last number is the 1. A group of threads draws the mask for some cells and then shares those that
// change among its threads: the others cost nothing but a copy.

struct Step {
  key: u32,         // What hashes are combined with in this step.
  threshold: u32,   // The hash from which a cell does not change.
  always: u32,      // 1 where all cells change.
  unused: u32,
}

const THREADS = 64u;
const CELLS_OF_GROUP = 256u;
const FILTERS = 5u;
const INPUTS = FILTERS * PLANES + TOLD;
const OF_UNIT = INPUTS + PLANES;

@group(0) @binding(2) var<uniform> now: Step;
@group(0) @binding(3) var<uniform> stencil: array<vec4f, 54>;  // By neighbour: four filters; the fifth.
@group(0) @binding(4) var<storage, read> weights: array<vec4<Factor>>;  // By unit: of W1, of W2.
@group(0) @binding(5) var<storage, read> told: array<vec4f>;
@group(0) @binding(6) var<storage, read> state: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> next: array<vec4f>;

var<workgroup> changing: array<u32, CELLS_OF_GROUP>;
var<workgroup> found: atomic<u32>;

// Wellons' lowbias32, as in \`engine/automaton.py\`.
fn mix_bits(given: u32) -> u32 {
  var value = given;
  value ^= value >> 16u;
  value *= 0x7feb352du;
  value ^= value >> 15u;
  value *= 0x846ca68bu;
  value ^= value >> 16u;
  return value;
}

fn changes(row: u32) -> bool {
  if (now.always == 1u) {
    return true;
  }
  let cell = vec3u(cell_of(row));
  let hash = mix_bits(cell.x + mix_bits(cell.y + mix_bits(cell.z)));
  return mix_bits(hash ^ now.key) < now.threshold;
}

fn update(row: u32) {
  var inputs: array<vec4<Factor>, INPUTS>;
  var perceived: array<vec4f, FILTERS * PLANES>;
  let cell = cell_of(row);
  for (var k = 0u; k < 27u; k++) {
    let offset = vec3i(vec3u(k / 9u, (k / 3u) % 3u, k % 3u)) - 1;
    let beside = row_of(bordered(cell + offset));
    if (beside >= sites.cells) {
      continue;  // The outside is zero.
    }
    let four = stencil[2u * k];
    let fifth = stencil[2u * k + 1u].x;
    for (var p = 0u; p < PLANES; p++) {
      let seen = state[beside * PLANES + p];
      perceived[p] += four.x * seen;
      perceived[PLANES + p] += four.y * seen;
      perceived[2u * PLANES + p] += four.z * seen;
      perceived[3u * PLANES + p] += four.w * seen;
      perceived[4u * PLANES + p] += fifth * seen;
    }
  }
  for (var i = 0u; i < FILTERS * PLANES; i++) {
    inputs[i] = vec4<Factor>(perceived[i]);
  }
  for (var i = 0u; i < TOLD; i++) {
    inputs[FILTERS * PLANES + i] = vec4<Factor>(told[row * TOLD + i]);
  }
  var change: array<vec4f, PLANES>;
  for (var unit = 0u; unit < HIDDEN; unit++) {
    let first = unit * OF_UNIT;
    var sum = 0.0;
    for (var i = 0u; i < INPUTS; i++) {
      sum += f32(dot(inputs[i], weights[first + i]));
    }
    if (sum > 0.0) {
      let hidden = Factor(sum);
      for (var p = 0u; p < PLANES; p++) {
        change[p] += vec4f(hidden * weights[first + INPUTS + p]);
      }
    }
  }
  for (var p = 0u; p < PLANES; p++) {
    next[row * PLANES + p] = state[row * PLANES + p] + change[p];
  }
}

@compute @workgroup_size(THREADS)
fn step(
  @builtin(workgroup_id) group: vec3u,
  @builtin(num_workgroups) groups: vec3u,
  @builtin(local_invocation_index) thread: u32,
) {
  // The language zeroes it; Mesa 22's software driver does not.
  if (thread == 0u) {
    atomicStore(&found, 0u);
  }
  workgroupBarrier();
  let first = (group.y * groups.x + group.x) * CELLS_OF_GROUP;
  for (var at = thread; at < CELLS_OF_GROUP; at += THREADS) {
    let row = first + at;
    if (row >= sites.cells) {
      continue;
    }
    if (changes(row)) {
      changing[atomicAdd(&found, 1u)] = row;
    } else {
      for (var p = 0u; p < PLANES; p++) {
        next[row * PLANES + p] = state[row * PLANES + p];
      }
    }
  }
  workgroupBarrier();
  let count = atomicLoad(&found);
  for (var at = thread; at < count; at += THREADS) {
    update(changing[at]);
  }
}
`;var se=class{constructor(e,t){this.lower=e;this.upper=t;this.size=[0,1,2].map(r=>t[r]-e[r]),this.values=new Uint8Array(this.size[0]*this.size[1]*this.size[2])}lower;upper;size;values;at(e,t,r){let[s,i,n]=this.lower;return((e-s)*this.size[1]+(t-i))*this.size[2]+(r-n)}holds(e,t,r){let{lower:s,upper:i}=this;return e>=s[0]&&e<i[0]&&t>=s[1]&&t<i[1]&&r>=s[2]&&r<i[2]}spread(e,t){let{size:r,values:s}=this,i=[r[1]*r[2],r[2],1],n=Uint8Array.from(s,o=>o>0?1:0);for(let o=0;o<3;o++){let l=i[o],u=r[o],c=n.slice();for(let h=0;h<c.length;h++){if(c[h]===0)continue;let f=Math.floor(h/l)%u,d=-Math.min(e,f),p=Math.min(e,u-1-f);for(let m=d;m<=p;m++)n[h+m*l]=1}}for(let o=0;o<s.length;o++)s[o]===0&&n[o]===1&&(s[o]=t)}};function ze(a,e,t,r,s){let i=a.lower.map(l=>l-r),n=a.upper.map(l=>l+r),o=new se(i,n);return s?o.values.fill(1):(mt(o,a,e,255*Math.sqrt(.01*t/a.density)),o.spread(r,1),o.spread(3,2)),bt(o,a)}function mt(a,e,t,r){for(let s=0;s<t.count;s++){let[i,n,o]=[0,1,2].map(l=>8*t.bricks[3*s+l]);for(let l=0;l<512;l++){if(t.planes[512*s+l]<=r)continue;let[u,c,h]=[i+(l>>6),n+(l>>3&7),o+(l&7)];u>=e.lower[0]&&u<e.upper[0]&&c>=e.lower[1]&&c<e.upper[1]&&h>=e.lower[2]&&h<e.upper[2]&&(a.values[a.at(u,c,h)]=1)}}}function bt(a,e){let t=a.lower.map(p=>Math.floor(p/8)),r=a.upper.map((p,m)=>Math.floor((p-1)/8)+1-t[m]),s=new Uint32Array(r[0]*r[1]*r[2]).fill(4294967295),i=[],n=[],o=[],l=[],u=0;for(let p=0;p<r[0];p++)for(let m=0;m<r[1];m++)for(let y=0;y<r[2];y++,u++){let P=[8*(p+t[0]),8*(m+t[1]),8*(y+t[2])];gt(a,e,P,n.length,o,l)&&(s[u]=n.length,n.push(u),i.push(p+t[0],m+t[1],y+t[2]))}let c=n.length,h=s.length+3*c,f=new Uint32Array(h+512*c+o.length+l.length);f.set(s),f.set(Int32Array.from(i),s.length),f.fill(4294967295,h,h+512*c),[o,l].flat().forEach((p,m)=>{f[h+p]=m,f[h+512*c+m]=p});let d=new Int32Array(16);return d.set([...a.lower,o.length,...a.upper,0,...t,c,...r,0]),{cells:o.length,beside:l.length,uniform:d,places:f}}function gt(a,e,[t,r,s],i,n,o){let l=n.length+o.length;for(let u=0;u<512;u++){let[c,h,f]=[t+(u>>6),r+(u>>3&7),s+(u&7)];if(!a.holds(c,h,f))continue;let d=a.values[a.at(c,h,f)];d===1?n.push(512*i+u):d===2&&c>=e.lower[0]&&c<e.upper[0]&&h>=e.lower[1]&&h<e.upper[1]&&f>=e.lower[2]&&f<e.upper[2]&&o.push(512*i+u)}return n.length+o.length>l}function Ee(a,e){let[,,,,,,,,t,r,s,i,n,o,l]=a.uniform,[,,,,,,,,u,c,h,f,d,p,m]=e.uniform,y=n*o*l,v=d*p*m+3*f,S=new Uint32Array(a.cells).fill(4294967295);for(let b=0;b<a.cells;b++){let g=a.places[y+515*i+b],w=y+3*(g>>>9),U=(a.places[w]|0)-u,T=(a.places[w+1]|0)-c,G=(a.places[w+2]|0)-h;if(U<0||T<0||G<0||U>=d||T>=p||G>=m)continue;let R=e.places[(U*p+T)*m+G];if(R===4294967295)continue;let M=e.places[v+512*R+(g&511)];M<e.cells&&(S[b]=M)}return S}var Y=256,Ge=64,j=class a{constructor(e,t,r,s,i){this.gpu=e;this.rule=t;this.smoke=r;this.pipelines=s;this.isHalf=i;let n=4*z(t.width+1);this.uniform=e.uniform(64),this.steps=e.uniform(Y*Ge),this.filters=e.uniform(864),e.write(this.filters,be(t.sobel,t.laplacian)),this.weights=e.buffer(ge(t,n,i),"the rule"),this.network=e.buffer(ye(t),"the decoder"),this.given=e.uniform(112),this.now=Array.from({length:14},()=>e.uniform(32))}gpu;rule;smoke;pipelines;isHalf;sites=null;stepsDone=0;painted=null;uniform;places=null;state=null;spare=null;told=null;paintedFor=0;steps;filters;weights;network;given;now;static async create(e,t,r,s){let i=s&&e.hasHalf,n=`const PLANES = ${z(t.channels)}u;
`,o=t.decoder.length>0?z(t.decoder[0].weights.rows):0,l=z(t.width+1),u=i?`enable f16;
alias Factor = f16;
`:`alias Factor = f32;
`,c=`const TOLD = ${l}u;
const HIDDEN = ${t.hidden.rows}u;
`,h=`${n}const UNITS4 = ${o}u;
${N}${_e}${Ae}`,[f,d,p,m,y]=await Promise.all([e.compute(`${u}${n}${c}${N}${Te}`,"step"),e.compute(`${N}${L}${Ue}`,"condition"),e.compute(`${n}${Se}`,"carry"),e.compute(h,"paint"),e.compute(h,"rim")]);return new a(e,t,r,{step:f,condition:d,carry:p,paint:m,rim:y},i)}enter(e,t){let{gpu:r,rule:s}=this,i=ze(this.smoke,e.frame,s.density,s.dilation,s.wholeBox),n=r.buffer(i.places,"the list of cells"),o=(i.cells+1)*16*z(s.channels),l=r.buffer(o,"the state");if(this.sites!==null&&this.state!==null&&i.cells>0){let u=r.buffer(Ee(i,this.sites),"the list of cells"),{carry:c}=this.pipelines,h=r.bound(c,0,{0:u,1:this.state,2:l});r.submit(f=>A(f,c,[h],Math.ceil(i.cells/64))),u.destroy()}this.release(),r.write(this.uniform,i.uniform),this.sites=i,this.places=n,this.state=l,this.spare=r.buffer(o,"the state"),this.told=r.buffer(i.cells*16*z(s.width+1),"the conditioning"),this.condition(e,t)}condition(e,t){let{gpu:r,rule:s,sites:i}=this;if(i===null||i.cells===0)return;let n=new ArrayBuffer(112),o=new Float32Array(n),l=this.placeMatrix();for(let p=0;p<16;p++)o[p]=l[p%4][p>>2];let{position:u=-1,density:c=-1,velocity:h=-1}=s.columns;new Int32Array(n).set([u,c,h,4*z(s.width+1)],16),o.set([s.density,s.speed],20),o.set([...this.alongCells(t.direction),t.amount],24),r.write(this.given,o);let{condition:f}=this.pipelines,d=[r.bound(f,0,{0:this.uniform,1:this.places}),r.bound(f,1,{0:this.given,1:this.told}),r.bound(f,2,{0:e.uniform,1:e.bytes})];r.submit(p=>A(p,f,d,Math.ceil(i.cells/64)))}alongCells(e){let t=I(this.smoke.toWorld),r=[0,1,2].map(i=>e.reduce((n,o,l)=>n+t[i][l]*o,0)),s=Math.hypot(...r)||1;return r.map(i=>i/s)}placeMatrix(){let{place:e,dilation:t}=this.rule,r=[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]],s=this.smoke.lower.map(n=>n-t),i=this.smoke.upper.map(n=>n+t);if(e!==null){let n=we(I(e.toWorld),this.smoke.toWorld);this.isNear(n,e.lower,e.upper)&&([r,s,i]=[n,e.lower,e.upper])}return r.map((n,o)=>{if(o===3)return n;let l=2/(i[o]-s[o]),u=n.map(c=>c*l);return u[3]+=(1-2*s[o])/(i[o]-s[o])-1,u})}isNear(e,t,r){let s=[1/0,1/0,1/0],i=[-1/0,-1/0,-1/0];for(let n=0;n<8;n++){let o=[0,1,2].map(l=>(n>>l&1?this.smoke.upper:this.smoke.lower)[l]-.5);for(let l=0;l<3;l++){let[u,c,h,f]=e[l],d=u*o[0]+c*o[1]+h*o[2]+f;s[l]=Math.min(s[l],d),i[l]=Math.max(i[l],d)}}return[0,1,2].every(n=>i[n]>t[n]-.5&&s[n]<r[n]-.5)}step(e,t){let{gpu:r,rule:s,sites:i}=this;for(let n=0;n<e;){let o=Math.min(Ge,e-n),l=new Uint32Array(Y/4*o);for(let u=0;u<o;u++){let c=pe(t,this.stepsDone+n+u),h=s.probability>=1?1:0;l.set([c,me(s.probability),h,0],Y/4*u)}r.write(this.steps,l),i!==null&&i.cells>0&&this.submitSteps(o),n+=o}this.stepsDone+=e}submitSteps(e){let{gpu:t,sites:r}=this,{step:s}=this.pipelines;t.submit(i=>{for(let n=0;n<e;n++){let o=t.bound(s,0,{0:this.uniform,1:this.places,2:{buffer:this.steps,offset:Y*n,size:16},3:this.filters,4:this.weights,5:this.told,6:this.state,7:this.spare});A(i,s,[o],Math.ceil(r.cells/256)),[this.state,this.spare]=[this.spare,this.state]}})}paint(e,t){let{gpu:r,rule:s,sites:i}=this;if(i===null)return;let n=(i.cells+i.beside)*e**3;if((this.painted===null||this.paintedFor!==n)&&(this.painted?.destroy(),this.painted=r.buffer(16*n,"the painting"),this.paintedFor=n),n===0)return;let{paint:o,rim:l}=this.pipelines,u=[i.cells,...Array(3*e+1).fill(i.beside)];u.forEach((f,d)=>{let p=new Int32Array([e,t,Math.max(d-1,0),f,s.dilation,0,0,0]);r.write(this.now[d],p)});let c={0:this.uniform,1:this.places},h=[r.bound(o,0,c),r.bound(o,1,{0:this.network}),r.bound(o,2,{0:this.now[0],1:this.state,2:this.painted})];r.submit(f=>{let d=p=>Math.ceil(p*e**3/64);i.cells>0&&A(f,o,h,d(i.cells));for(let p=1;p<u.length&&i.beside>0;p++){let m=[r.bound(l,0,c),r.bound(l,1,{}),r.bound(l,2,{0:this.now[p],2:this.painted})];A(f,l,m,d(i.beside))}})}reset(){this.release(),this.sites=null,this.stepsDone=0}release(){for(let e of[this.places,this.state,this.spare,this.told,this.painted])e?.destroy();this.places=this.state=this.spare=this.told=this.painted=null,this.paintedFor=0}destroy(){this.release();let e=[this.uniform,this.steps,this.filters,this.weights,this.network,this.given];for(let t of[...e,...this.now])t.destroy()}};var ne=`// How much smoke lies between each place and the light, as \`rendering/light.py\` finds it: layer by
// layer away from the light, of means over blocks of cells.

struct Light {
  first: vec3i,     // The lowest block: blocks hold the cells from block · times on.
  main: u32,        // The axis that layers follow,
  size: vec3i,      // How many blocks there are along each axis.
  times: i32,       // Cells along an edge of a block.
  origin: vec3i,    // Index coordinates of the first cell of what is drawn, the cell beside the box.
  is_up: u32,       // 1 where the light stands where that axis leads to.
  shift: vec2f,     // Blocks along the two other axes that light comes from, a layer before.
  half: f32,        // Half the way through a block along the ray, times γ.
  layer: i32,
}

@group(0) @binding(0) var<uniform> light: Light;
@group(0) @binding(1) var drawn: texture_3d<f32>;
@group(0) @binding(2) var<storage, read_write> thickness: array<f32>;
@group(0) @binding(3) var<storage, read_write> depth: array<f32>;
@group(0) @binding(4) var reached: texture_storage_3d<rgba16float, write>;

fn number(block: vec3i) -> u32 {
  return u32((block.x * light.size.y + block.y) * light.size.z + block.z);
}

@compute @workgroup_size(4, 4, 4)
fn gather(@builtin(global_invocation_id) thread: vec3u) {
  let block = vec3i(thread);
  if (any(block >= light.size)) {
    return;
  }
  var sum = 0.0;
  let corner = (light.first + block) * light.times - light.origin;
  for (var x = 0; x < light.times; x++) {
    for (var y = 0; y < light.times; y++) {
      for (var z = 0; z < light.times; z++) {
        let at = corner + vec3i(x, y, z);
        if (all(at >= vec3i(0)) && all(at < vec3i(textureDimensions(drawn)))) {
          sum += textureLoad(drawn, at, 0).w;
        }
      }
    }
  }
  thickness[number(block)] = light.half * sum / f32(light.times * light.times * light.times);
}

// A block of a layer by its place there; outside it is nothing.
fn block_of(layer: i32, place: vec2i) -> vec3i {
  let along = select(layer, light.size[light.main] - 1 - layer, light.is_up == 1u);
  switch (light.main) {
    case 0u: { return vec3i(along, place.x, place.y); }
    case 1u: { return vec3i(place.x, along, place.y); }
    default: { return vec3i(place.x, place.y, along); }
  }
}

fn behind(layer: i32, place: vec2i) -> f32 {
  let block = block_of(layer, place);
  if (any(block < vec3i(0)) || any(block >= light.size)) {
    return 0.0;
  }
  return depth[number(block)] + thickness[number(block)];
}

@compute @workgroup_size(8, 8)
fn sweep(@builtin(global_invocation_id) thread: vec3u) {
  let place = vec2i(thread.xy);
  let block = block_of(light.layer, place);
  if (any(block >= light.size)) {
    return;
  }
  var value = 0.0;
  if (light.layer > 0) {
    let low = floor(light.shift);
    let part = light.shift - low;
    let at = place + vec2i(low);
    let before = light.layer - 1;
    let first = mix(behind(before, at), behind(before, at + vec2i(1, 0)), part.x);
    let second = mix(behind(before, at + vec2i(0, 1)), behind(before, at + vec2i(1, 1)), part.x);
    value = mix(first, second, part.y) + thickness[number(block)];
  }
  depth[number(block)] = value;
  textureStore(reached, block, vec4f(value, 0.0, 0.0, 0.0));
}
`;var Me=`// Emission and absorption along the rays of a camera, as \`rendering/\` adds them up: samples lie at
// whole multiples of a step from the eye, and colour is the quotient of what is interpolated.

struct Camera {
  eye: vec4f,        // In cells of what is drawn.
  middle: vec4f,     // The direction of the picture's middle, for a length of depth; w: the step.
  right: vec4f,      // What is added to it for a picture's height to the right; w: aspect,
  up: vec4f,         // and for one up; w: γ times the step.
  size: vec4f,       // Of what is drawn, in cells; w: how much of the picture, from the left.
  blocks: vec4f,     // The first block of the light, in cells; w: cells along an edge of a block.
  light: vec4f,      // glow, strength, ambient, and 1 where there is a light.
  octaves: vec4f,    // Their weights over what faces the light.
}

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var drawn: texture_3d<f32>;
@group(0) @binding(2) var reached: texture_3d<f32>;
@group(0) @binding(3) var between: sampler;

struct Corner {
  @builtin(position) position: vec4f,
  @location(0) place: vec2f,  // −½ … ½, up.
}

@vertex
fn corner(@builtin(vertex_index) index: u32) -> Corner {
  let at = vec2f(f32((index << 1u) & 2u), f32(index & 2u));
  return Corner(vec4f(2.0 * at - 1.0, 0.0, 1.0), at - 0.5);
}

fn lit(cell: vec3f) -> f32 {
  let size = vec3f(textureDimensions(reached));
  let at = (cell - camera.blocks.xyz) / camera.blocks.w;
  let depth = textureSampleLevel(reached, between, (at + 0.5) / size, 0.0).x;
  let direct = dot(camera.octaves.xyz, exp(-depth * vec3f(1.0, 0.25, 0.0625)));
  return camera.light.x
    + camera.light.y * (camera.light.z + (1.0 - camera.light.z) * min(direct, 1.0));
}

@fragment
fn march(@location(0) place: vec2f) -> @location(0) vec4f {
  let ray = camera.middle.xyz + place.x * camera.right.w * camera.right.xyz + place.y * camera.up.xyz;
  let step = camera.middle.w;
  // Lengths are those of a cell; what is drawn has cubic cells.
  let way = normalize(ray);
  let a = (vec3f(-0.5) - camera.eye.xyz) / way;
  let b = (camera.size.xyz - 0.5 - camera.eye.xyz) / way;
  let near = max(max(min(a.x, b.x), max(min(a.y, b.y), min(a.z, b.z))), 0.0);
  let far = min(max(a.x, b.x), min(max(a.y, b.y), max(a.z, b.z)));
  let first = ceil(near / step);
  let last = floor(far / step);
  var colour = vec3f(0.0);
  var seen = 0.0;
  for (var k = first; k <= last; k += 1.0) {
    let cell = camera.eye.xyz + k * step * way;
    let value = textureSampleLevel(drawn, between, (cell + 0.5) / camera.size.xyz, 0.0);
    if (value.w <= 0.0) {
      continue;
    }
    let weight = (1.0 - seen) * (1.0 - exp(-camera.up.w * value.w));
    var hue = value.xyz / value.w;
    if (camera.light.w > 0.0) {
      hue *= lit(cell);
    }
    colour += weight * hue;
    seen += weight;
    if (seen > 0.9995) {
      break;
    }
  }
  return vec4f(colour, seen);
}
`;var Be=`// What is drawn: density, and colour times density, at every cell of the box and one beside it.

struct Volume {
  parts: i32,              // Of a cell along each axis.
  is_plain: u32,           // 1 shows the smoke as it was.
  has_under: u32,          // 1 where another rule's volume lies under this one.
  mixed: f32,              // How much of this one is seen over it everywhere,
  strength: f32,           // Of the colour.
  density_strength: f32,
  scale: f32,              // The density that counts as 1.
  unused: f32,
}

@group(1) @binding(0) var<uniform> look: Volume;
@group(1) @binding(1) var<storage, read> painted: array<vec4f>;
@group(1) @binding(2) var<storage, read> brushed: array<f32>;   // and how much more where, by cell.
@group(1) @binding(3) var under: texture_3d<f32>;
@group(1) @binding(4) var drawn: texture_storage_3d<rgba16float, write>;

// The density at the centre of a part of a cell; beyond the outermost cells of the box it stays.
fn density_of(fine: vec3i) -> f32 {
  if (look.parts == 1) {
    return density_at(fine);
  }
  let place = (vec3f(fine) + 0.5) / f32(look.parts) - 0.5;
  let below = floor(place);
  let part = place - below;
  var sum = 0.0;
  for (var corner = 0u; corner < 8u; corner++) {
    let step = vec3i(vec3u(corner >> 2u, (corner >> 1u) & 1u, corner & 1u));
    let share = select(1.0 - part, part, step == vec3i(1));
    let cell = clamp(vec3i(below) + step, smoke.lower, smoke.upper - 1);
    sum += share.x * share.y * share.z * density_at(cell);
  }
  return sum;
}

@compute @workgroup_size(4, 4, 4)
fn volume(@builtin(global_invocation_id) thread: vec3u) {
  let size = textureDimensions(drawn);
  if (any(thread >= size)) {
    return;
  }
  let fine = vec3i(thread) - 1 + smoke.lower * look.parts;
  let coarse = vec3i(floor((vec3f(fine) + 0.5) / f32(look.parts)));
  var value = vec4f(0.0);
  if (all(coarse >= smoke.lower) && all(coarse < smoke.upper)) {
    let density = density_of(fine) / look.scale;
    if (density > 0.0) {
      var colour = vec4f(1.0);
      let row = row_of(coarse);
      if (row != NOWHERE && look.is_plain == 0u) {
        let inside = fine - coarse * look.parts;
        let parts = u32(look.parts * look.parts * look.parts);
        let part = u32((inside.x * look.parts + inside.y) * look.parts + inside.z);
        colour = painted[row * parts + part];
        colour.w = select(1.0, colour.w, row < sites.cells);
      }
      let shown = 1.0 + look.strength * (colour.xyz - 1.0);
      let thick = density * (1.0 + look.density_strength * (colour.w - 1.0));
      value = vec4f(shown * thick, thick);
    }
    if (look.has_under == 1u) {
      let at = coarse - smoke.lower;
      let side = smoke.upper - smoke.lower;
      let more = brushed[u32((at.x * side.y + at.y) * side.z + at.z)];
      value = mix(textureLoad(under, thread, 0), value, clamp(look.mixed + more, 0.0, 1.0));
    }
  }
  textureStore(drawn, thread, value);
}
`;var xt=96,Ie=[[.5,1],[.3,1/4],[.2,1/16]],kt=Ie.reduce((a,[e,t])=>a+e/(1+t),0),Pt=2**27,ie="rgba16float",O=class a{constructor(e,t,r){this.gpu=e;this.smoke=t;this.pipelines=r;this.looks=[0,1].map(()=>e.uniform(32)),this.camera=e.uniform(128),this.sampler=e.device.createSampler({magFilter:"linear",minFilter:"linear"}),this.nothing=this.texture([1,1,1])}gpu;smoke;pipelines;parts=0;size=[];textures=[];drawn=null;reached=null;blocks=null;thickness=null;depth=null;looks;camera;sampler;nothing;static async create(e,t){let[r,s,i,n]=await Promise.all([e.compute(`${N}${L}${Be}`,"volume"),e.compute(ne,"gather"),e.compute(ne,"sweep"),e.render(Me,"march",ie)]);return new a(e,t,{volume:r,gather:s,sweep:i,march:n})}refine(e){if(e===this.parts)return;this.release();let{lower:t,upper:r}=this.smoke;this.size=t.map((n,o)=>(r[o]-n)*e+2);let s=this.gpu.device.limits.maxTextureDimension3D,i=this.size.reduce((n,o)=>n*o,1);if(Math.max(...this.size)>s||i>Pt){let n=this.size.join(" × ");throw new x(`A volume of ${n} (${D(8*i)}) is more than this page draws: choose a smaller sequence or less detail.`)}this.parts=e,this.textures=[0,1].map(()=>this.texture(this.size)),this.makeBlocks()}makeBlocks(){let{gpu:e,smoke:t,parts:r}=this,[s,i]=St(t,r),n=Math.max(...s.map((f,d)=>i[d]-f))/xt,o=Math.max(Math.round(n),1),l=t.lower.map(f=>Math.floor(f*r/o)-1),u=t.upper.map(f=>Math.floor((f*r-1)/o)+1),c=l.map((f,d)=>u[d]-f+1),h=c.reduce((f,d)=>f*d,1);this.reached=this.texture(c),this.thickness=e.buffer(4*h,"the light"),this.depth=e.buffer(4*h,"the light"),this.blocks={first:l,size:c,times:o,slots:e.uniform(256*Math.max(...c))}}texture(e){return this.gpu.device.createTexture({size:e,dimension:"3d",format:"rgba16float",usage:GPUTextureUsage.TEXTURE_BINDING|GPUTextureUsage.STORAGE_BINDING|GPUTextureUsage.COPY_SRC})}draw(e,t,r,s){let i=this.nothing;t.forEach((n,o)=>{let l=new ArrayBuffer(32),u=s.isPlain?1:0;new Int32Array(l).set([this.parts,u,o>0?1:0]);let{mixed:c,strength:h,densityStrength:f}=s,d=s.isPlain?0:f;new Float32Array(l).set([c,h,d,n.rule.density],3),this.gpu.write(this.looks[o],new Uint8Array(l)),i=this.drawLayer(e,n,o,r,i)}),this.drawn=i,s.light.strength>0&&this.shine(s)}drawLayer(e,t,r,s,i){let{gpu:n}=this,{volume:o}=this.pipelines,l=this.textures[r],u=[n.bound(o,0,{0:t.uniform,1:t.places}),n.bound(o,1,{0:this.looks[r],1:t.painted,2:s,3:i.createView(),4:l.createView()}),n.bound(o,2,{0:e.uniform,1:e.bytes})];return n.submit(c=>A(c,o,u,Le(this.size))),l}shine({light:e,gamma:t}){let{gpu:r,parts:s}=this,{gather:i,sweep:n}=this.pipelines,{first:o,size:l,times:u,slots:c}=this.blocks,[,,h]=B(e.azimuth,e.elevation),f=_(K(this.smoke,_(h,-1)),1/u),d=f.map(Math.abs).reduce((b,g,w,U)=>g>U[b]?w:b,0),p=[0,1,2].filter(b=>b!==d),m=p.map(b=>f[b]/Math.abs(f[d])),y=.5/Math.abs(f[d])*t/s,P=this.smoke.lower.map(b=>b*s-1),v=new ArrayBuffer(256*l[d]);for(let b=0;b<l[d];b++){let g=new Int32Array(v,256*b,16),w=new Float32Array(v,256*b,16);g.set([...o,d,...l,u,...P,f[d]>0?1:0]),w.set([...m,y],12),g[15]=b}r.write(c,new Uint8Array(v));let S=b=>({buffer:c,offset:256*b,size:64});r.submit(b=>{let g={1:this.drawn.createView(),2:this.thickness};A(b,i,[r.bound(i,0,{0:S(0),...g})],Le(l));let[w,U]=p.map(T=>Math.ceil(l[T]/8));for(let T=0;T<l[d];T++){let G=r.bound(n,0,{0:S(T),2:this.thickness,3:this.depth,4:this.reached.createView()});A(b,n,[G],[w,U,1])}})}take(e,t,r,s,i,[n,o]=[0,1],l=!0){let{gpu:u,parts:c}=this,h=t.width/t.height,f=2*C(r.fieldOfView),[d,p,m]=B(r.azimuth,r.elevation),y=M=>K(this.smoke,M),{light:P}=s,v=Math.max(1-P.strength,0),S=this.blocks,b=S.first.map((M,Oe)=>(M+.5)*S.times-.5-this.smoke.lower[Oe]*c+1),g=new Float32Array([...this.place(q(r)),0,...y(m),i,...y(_(d,f)),h,...y(_(p,f)),s.gamma/c*i,...this.size,0,...b,S.times,v,P.strength,P.ambient,P.strength>0?1:0,...Ie.map(([M])=>M/kt),0]);u.write(this.camera,g);let{march:w}=this.pipelines,U=e.beginRenderPass({colorAttachments:[{view:t.createView(),loadOp:l?"clear":"load",storeOp:"store",clearValue:[0,0,0,0]}]});U.setPipeline(w);let T=u.bound(w,0,{0:this.camera,1:this.drawn.createView(),2:this.reached.createView(),3:this.sampler});U.setBindGroup(0,T);let G=Math.round(n*t.width),R=Math.round(o*t.width)-G;R>0&&(U.setScissorRect(G,0,R,t.height),U.draw(3)),U.end()}place(e){return te(I(this.smoke.toWorld),e).map((r,s)=>(r+.5)*this.parts-.5-this.smoke.lower[s]*this.parts+1)}get texture3d(){return this.drawn}get cells(){return this.size}get refinement(){return this.parts}release(){for(let e of this.textures)e.destroy();for(let e of[this.reached,this.thickness,this.depth,this.blocks?.slots])e?.destroy()}destroy(){this.release();for(let e of[this.camera,this.nothing,...this.looks])e.destroy()}};function K(a,e){return _(ve(I(a.toWorld),e),Re(a))}function Re(a){return Math.hypot(...[0,1,2].map(e=>a.toWorld[e][0]))}function St(a,e){let t=Re(a)/e,[r,s]=oe(a,a.toWorld);return[_(r,1/t),_(s,1/t)]}function oe(a,e){let t=Array.from({length:8},(s,i)=>{let n=[0,1,2].map(o=>(i>>o&1?a.upper:a.lower)[o]-.5);return te(e,n)}),r=s=>[0,1,2].map(i=>s(...t.map(n=>n[i])));return[r(Math.min),r(Math.max)]}function Le(a){return a.map(e=>Math.ceil(e/4))}var At={seed:0,steps:0,warmup:64,strength:1,densityStrength:1,density:1,exposure:0,light:1.2,lightAzimuth:-55,lightElevation:40,ambient:.15,guide:0,guideAzimuth:0,guideElevation:90,mix:0,wipe:2,detail:1,brush:5},_t=30,Fe=.5,$e={1:3,2:2,3:2,4:2},Tt=[.005181516702338386,.005181516702338386,.006995410187265387],X=class a{constructor(e,t,r,s,i,n){this.gpu=e;this.smoke=t;this.painting=r;this.plain=s;this.pipelines=i;this.format=n;let o=t.lower.map((l,u)=>t.upper[u]-l);this.brushed=e.buffer(4*o[0]*o[1]*o[2],"the mix of two rules"),this.brush=e.uniform(64),this.hit=e.buffer(16,"a point"),this.screen=e.uniform(32),this.sampler=e.device.createSampler({magFilter:"linear",minFilter:"linear"}),this.camera=this.framed(1)}gpu;smoke;painting;plain;pipelines;format;settings={...At};camera;at=-1;layers=[];samples=0;buffers=null;stale={state:!0,look:!0};picture=null;brushed;brush;hit;screen;sampler;static async create(e,t,r){let s=`const PLANES = 1u;
${N}${L}${ee}`,[i,n,o,l,u]=await Promise.all([O.create(e,t),O.create(e,t),e.compute(s,"meet"),e.compute(s,"blend"),e.render(fe,"present",r)]);return new a(e,t,i,n,{meet:o,blend:l,present:u},r)}framed(e,t=0,r=5){let[s,i]=oe(this.smoke,this.smoke.toWorld);return Pe(s,i,t,r,e,_t)}async use(e,t,r=!1){let s=e===null?null:await j.create(this.gpu,e,this.smoke,r);this.layers[t]?.destroy(),s===null?this.layers.length=t:(this.layers[t]=s,this.buffers!==null&&this.begin(s)),this.stale.state=!0}get guide(){let{guide:e,guideAzimuth:t,guideElevation:r}=this.settings,[,,s]=B(t,-r);return{direction:s,amount:e}}begin(e){e.enter(this.buffers,this.guide),this.frameSteps(e,this.settings.warmup)}frameSteps(e,t){let r=this.settings.steps||e.rule.steps;e.step(t+r,this.settings.seed)}async show(e){this.enterFrame(await this.smoke.frame(e),e)}enterFrame(e,t){this.release(),this.buffers=this.upload(e),this.at=t;for(let r of this.layers){let s=r.sites===null||r.sites.cells===0;r.enter(this.buffers,this.guide),this.frameSteps(r,s?this.settings.warmup:0)}this.stale.state=!0,t+1<this.smoke.length&&this.smoke.frame(t+1).catch(()=>{})}async restart(){for(let e of this.layers)e.reset();this.gpu.write(this.brushed,new Float32Array(this.brushed.size/4)),await this.show(0)}upload(e){let{gpu:t,smoke:r}=this,s=r.lower.map(f=>Math.floor(f/8)),i=r.upper.map((f,d)=>Math.floor((f-1)/8)+1-s[d]),n=new Uint32Array(i[0]*i[1]*i[2]).fill(4294967295);for(let f=0;f<e.count;f++){let[d,p,m]=[0,1,2].map(y=>e.bricks[3*f+y]-s[y]);n[(d*i[1]+p)*i[2]+m]=f}let o=new Uint8Array(n.byteLength+e.planes.length);o.set(new Uint8Array(n.buffer)),o.set(e.planes,n.byteLength);let l=new ArrayBuffer(64),u=new Int32Array(l),c=new Float32Array(l);u.set(r.lower),c[3]=r.density,u.set(r.upper,4),c[7]=r.speed,u.set([...s,e.count,...i],8);let h=t.uniform(64);return t.write(h,new Uint8Array(l)),{frame:e,uniform:h,bytes:t.buffer(o,"the smoke")}}step(e){for(let t of this.layers)t.step(e,this.settings.seed);this.stale.state=!0}conditionAgain(){if(this.buffers!==null)for(let e of this.layers)e.condition(this.buffers,this.guide)}lookAgain(){this.stale.look=!0}look(e=!1){let t=this.settings,[r]=this.layers;return{strength:e?0:t.strength,densityStrength:t.densityStrength,gamma:r.rule.gamma*t.density,light:{strength:t.light,azimuth:t.lightAzimuth,elevation:t.lightElevation,ambient:t.ambient},isPlain:e,mixed:t.mix}}get parts(){return this.layers.every(e=>e.rule.decoder.length>0)?this.settings.detail:1}prepare(){if(this.buffers===null||this.layers.length===0)return;let{parts:e}=this;if(e!==this.painting.refinement&&(this.stale.state=!0),this.stale.state){let t=this.samples||$e[e];for(let r of this.layers)r.paint(e,Math.min(t,$e[e]))}if((this.stale.state||this.stale.look)&&(this.painting.refine(e),this.painting.draw(this.buffers,this.layers,this.brushed,this.look()),this.settings.wipe<1)){this.plain.refine(1);let[t]=this.layers;this.plain.draw(this.buffers,[t],this.brushed,this.look(!0))}this.stale={state:!1,look:!1}}take(e,t){this.prepare(),(this.picture?.width!==e||this.picture.height!==t)&&(this.picture?.destroy(),this.picture=this.gpu.device.createTexture({size:[e,t],format:ie,usage:GPUTextureUsage.RENDER_ATTACHMENT|GPUTextureUsage.TEXTURE_BINDING|GPUTextureUsage.COPY_SRC}));let r=this.picture;if(this.buffers===null||this.layers.length===0)return r;let s=Math.min(this.settings.wipe,1);return this.gpu.submit(i=>{let{camera:n}=this;this.painting.take(i,r,n,this.look(),Fe,[0,s]),s<1&&this.plain.take(i,r,n,this.look(!0),Fe,[s,1],!1)}),r}present(e,t,r,s){let{present:i}=this.pipelines,n=this.settings,o=n.light>0?1:0,l=[...Tt,o,2**n.exposure,n.wipe,r,s];this.gpu.write(this.screen,new Float32Array(l)),this.gpu.submit(u=>{let c=u.beginRenderPass({colorAttachments:[{view:t,loadOp:"clear",storeOp:"store",clearValue:[0,0,0,1]}]});c.setPipeline(i);let h=this.gpu.bound(i,0,{0:this.screen,1:e.createView(),2:this.sampler});c.setBindGroup(0,h),c.draw(3),c.end()})}async pixels(e,t){let r=this.take(e,t),{device:s}=this.gpu,i=GPUTextureUsage.RENDER_ATTACHMENT|GPUTextureUsage.COPY_SRC,n=s.createTexture({size:[e,t],format:this.format,usage:i});this.present(r,n.createView(),e,t);let o=new Uint8ClampedArray(await this.gpu.pixels(n,4));if(n.destroy(),this.format==="bgra8unorm")for(let l=0;l<o.length;l+=4)[o[l],o[l+2]]=[o[l+2],o[l]];return o}async touch(e,[t,r],s){if(this.buffers===null||this.layers.length===0)return;this.prepare();let{gpu:i,smoke:n}=this,[o,l,u]=B(this.camera.azimuth,this.camera.elevation),c=2*C(this.camera.fieldOfView),h=E(E(u,o,t*s*c),l,r*c),f=K(n,_(h,1/Math.hypot(...h))),{parts:d}=this,p=this.look().gamma/d;i.write(this.brush,new Float32Array([...this.painting.place(q(this.camera)),this.settings.brush,...f,p,...this.painting.cells,d,e==="less"?-.5:.5,0,0,0]));let{meet:m}=this.pipelines,y=this.painting.texture3d.createView(),P=i.bound(m,1,{0:this.brush,1:y,2:this.hit});i.submit(v=>A(v,m,[i.bound(m,0,{}),P],1)),e==="erase"?await this.erase():this.blend()}async erase(){let{gpu:e}=this;for(let t of this.layers){let r=`const PLANES = ${z(t.rule.channels)}u;
`,s=await e.compute(`${r}${N}${L}${ee}`,"erase");if(t.sites===null||t.sites.cells===0||this.buffers===null)continue;let i=[e.bound(s,0,{0:t.uniform,1:t.places}),e.bound(s,1,{0:this.brush,2:this.hit,3:t.state}),e.bound(s,2,{0:this.buffers.uniform})],n=t.sites.cells;e.submit(o=>A(o,s,i,Math.ceil(n/64)))}this.stale.state=!0}blend(){let{gpu:e,smoke:t}=this,{blend:r}=this.pipelines,s=t.lower.map((n,o)=>Math.ceil((t.upper[o]-n)/4)),i=[e.bound(r,0,{}),e.bound(r,1,{0:this.brush,2:this.hit,4:this.brushed}),e.bound(r,2,{0:this.buffers.uniform})];e.submit(n=>A(n,r,i,s)),this.stale.look=!0}release(){this.buffers?.uniform.destroy(),this.buffers?.bytes.destroy(),this.buffers=null}destroy(){this.release();for(let e of this.layers)e.destroy();this.painting.destroy(),this.plain.destroy();for(let e of[this.picture,this.brushed,this.brush,this.hit,this.screen])e?.destroy()}};var J=await(await fetch("show.json")).json(),zt=await W.open(J.smoke),Ce=await V.open(),ae=await X.create(Ce,zt,navigator.gpu.getPreferredCanvasFormat()),Et=await(await fetch(J.rules[0].model)).arrayBuffer();await ae.use(Q(Et,J.rules[0].name),0);Object.assign(globalThis,{stage:ae,gpu:Ce});Object.assign(globalThis,{useStyle:async a=>{let e=J.rules.find(t=>t.name===a);await ae.use(Q(await(await fetch(e.model)).arrayBuffer(),a),0)}});document.title="ready";
