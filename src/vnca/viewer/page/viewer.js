/* vnca, Apache-2.0; sources 730793b9a9fdc75f5d423df09b9d14a079b25285280adf4f0e21d1466618770b */
function S(e,t={},...i){let r=document.createElement(e);for(let[s,n]of Object.entries(t))typeof n=="function"?r.addEventListener(s.slice(2),n):typeof n=="boolean"?r.toggleAttribute(s,n):r.setAttribute(s,String(n));return r.append(...i),r}function is(e){let t="http://www.w3.org/2000/svg",i=document.createElementNS(t,"svg");i.setAttribute("viewBox","0 0 24 24"),i.setAttribute("aria-hidden","true");let r=document.createElementNS(t,"path");return r.setAttribute("d",e),i.append(r),i}function $(e,t,i){let r=S("button",{type:"button",title:e,"aria-label":e,onclick:i});return r.append(is(t)),r}function _i(e,t){let i=URL.createObjectURL(e);S("a",{href:i,download:t}).click(),setTimeout(()=>URL.revokeObjectURL(i),6e4)}function Ai(e,t){return e.map(i=>[0,1,2,3].map(r=>i.reduce((s,n,a)=>s+n*t[a][r],0)))}function Lt(e,t){return[0,1,2].map(i=>rt(e[i],t)+e[i][3])}function Ui(e,t){return[0,1,2].map(i=>rt(e[i],t))}function rt(e,t){return e[0]*t[0]+e[1]*t[1]+e[2]*t[2]}function me(e){let[t,i,r]=e.map(h=>h.slice(0,3)),s=(h,d)=>[h[1]*d[2]-h[2]*d[1],h[2]*d[0]-h[0]*d[2],h[0]*d[1]-h[1]*d[0]],n=[s(i,r),s(r,t),s(t,i)],a=rt(t,n[0]),l=[0,1,2].map(h=>n.map(d=>d[h]/a)),c=[e[0][3],e[1][3],e[2][3]];return[...l.map(h=>[...h,-rt(h,c)]),[0,0,0,1]]}function N(e,t,i=1){return e.map((r,s)=>r+i*t[s])}function R(e,t){return e.map(i=>i*t)}function Li(e,t){return e.reduce((i,r,s)=>i+r*t[s],0)}var Ct=Math.PI/180,rs=.04;function D(e,t){let[i,r]=[e*Ct,t*Ct],s=[Math.cos(i),Math.sin(i),0],n=[-Math.sin(i),Math.cos(i),0],a=[0,0,1],l=N(R(n,Math.sin(r)),a,Math.cos(r)),c=N(R(n,Math.cos(r)),a,-Math.sin(r));return[s,l,c]}function ae(e){return Math.tan(e*Ct/2)}function st(e){let[,,t]=D(e.azimuth,e.elevation);return N(e.target,t,-e.distance)}function zi(e,t,i,r,s,n){let a=D(i,r),l=R(N(e,t),.5),c=Array.from({length:8},(_,A)=>N([0,1,2].map(z=>(A>>z&1?t:e)[z]),l,-1)),[h,d,m]=a.map(_=>c.map(A=>Li(A,_))),u=(1-2*rs)*ae(n),[f,p]=Ci(h,m,u*s),[b,x]=Ci(d,m,u);return{target:N(N(l,a[0],f),a[1],b),azimuth:i,elevation:r,distance:Math.max(p,x),fieldOfView:n}}function Ci(e,t,i){let r=Math.max(...e.map((n,a)=>n-i*t[a])),s=Math.max(...e.map((n,a)=>-n-i*t[a]));return[(r-s)/2,(r+s)/(2*i)]}var Bi=.35,Ii=89,ss=12;function zt(e,t,i){e.azimuth=((e.azimuth+t)%360+360)%360,e.elevation=Math.min(Math.max(e.elevation+i,-Ii),Ii)}function Bt(e,t,i){let[r,s]=D(e.azimuth,e.elevation),n=2*e.distance*ae(e.fieldOfView);e.target=N(N(e.target,r,-t*n),s,-i*n)}function ze(e,t,i,r){e.distance=Math.min(Math.max(e.distance*t,i),r)}function Ni(e){let{canvas:t}=e,i=new Map,r=e.stage.camera.distance,s=r/20,n=r*10,a=!1,l=async u=>{if(a)return;a=!0;let{left:f,top:p,width:b,height:x}=t.getBoundingClientRect();await e.touch((u.clientX-f)/b,(u.clientY-p)/x),a=!1},c=u=>{let{left:f,width:p}=t.getBoundingClientRect();return(u.clientX-f)/p},h=!1,d=u=>e.tool!=="orbit"&&i.size===1&&!u.shiftKey&&!(u.buttons&6);t.addEventListener("pointerdown",u=>{t.setPointerCapture(u.pointerId),i.set(u.pointerId,u);let{wipe:f}=e.stage.settings;h=f<1&&Math.abs(c(u)-f)*t.clientWidth<ss,!h&&d(u)&&l(u)}),t.addEventListener("pointermove",u=>{let f=i.get(u.pointerId);if(f===void 0)return;let p=u.clientX-f.clientX,b=u.clientY-f.clientY,x=[...i.values()].find(_=>_.pointerId!==u.pointerId);if(i.set(u.pointerId,u),h)e.set("wipe",Math.min(Math.max(c(u),.02),.98));else if(d(u))l(u);else if(x!==void 0){let _=A=>Math.hypot(A.clientX-x.clientX,A.clientY-x.clientY)||1;e.look(A=>ze(A,_(f)/_(u),s,n)),e.move(p/2/t.clientHeight,-b/2/t.clientHeight)}else u.shiftKey||u.buttons&6?e.move(p/t.clientHeight,-b/t.clientHeight):e.look(_=>zt(_,-Bi*p,Bi*b))});let m=u=>{i.delete(u.pointerId),h=!1};t.addEventListener("pointerup",m),t.addEventListener("pointercancel",m),t.addEventListener("contextmenu",u=>u.preventDefault()),t.addEventListener("wheel",u=>{u.preventDefault();let f=u.deltaMode===WheelEvent.DOM_DELTA_LINE?30:1;e.look(p=>ze(p,Math.exp(f*u.deltaY/900),s,n))},{passive:!1}),t.addEventListener("dblclick",()=>e.reframe())}var M=class extends Error{};function B(e){let t=String(e instanceof Error?e.message:e).replace(/\s+/g," ").trim();return t.length>300?`${t.slice(0,300)}…`:t}function C(e,t){if(!e)throw new M(t)}var ns=6e3,Ri=0;function I(e){let t=document.getElementById("notice")??S("div",{id:"notice",role:"status"});t.textContent=B(e),t.classList.add("shown"),document.body.append(t),clearTimeout(Ri),Ri=window.setTimeout(()=>t.classList.remove("shown"),ns)}function nt(e,t){document.getElementById("stopped")?.remove(),document.body.classList.add("stopped"),document.body.append(S("main",{id:"stopped"},S("h1",{},e),S("p",{id:"reason"},B(t))))}var Wi="WebGPU is in current Chrome and Edge, in Safari 26 and in Firefox. On Linux Chrome may have to be started with --enable-unsafe-webgpu --enable-features=Vulkan.";var It=`// What a finger does: to the smoke that it points at, erase the state or change the mix of rules.

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
`;var Vi=`// The picture on the screen: in front of the soft background of films, as sRGB.

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
`;var ee=`// The smoke of a frame as its file has it: bytes of bricks, made into numbers where they are read.

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
`;var Y=`// Where cells lie: rows of the state by index coordinates, through a map of bricks of 8³ cells.
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
`;function W(e){return Math.ceil(e/4)}function Gi(e){let t=e;return t^=t>>>16,t=Math.imul(t,2146121005),t^=t>>>15,t=Math.imul(t,2221713035),t^=t>>>16,t>>>0}function $i(e,t){return Gi((e>>>0)+Gi(t>>>0)>>>0)}function Oi(e){return Math.min(Math.max(Math.round(e*2**32),1),2**32-1)}function Di(e,t){let i=new Float32Array(216),r=[1,2,1];for(let s=0;s<27;s++){let[n,a,l]=[Math.floor(s/9),Math.floor(s/3)%3,s%3],c=Math.abs(n-1)+Math.abs(a-1)+Math.abs(l-1);i.set([c===0?1:0,(n-1)*r[a]*r[l]/e,(a-1)*r[n]*r[l]/e,(l-1)*r[n]*r[a]/e,[-88,6,3,2][c]/t],8*s)}return i}function Nt(e,t,i){let{channels:r,hidden:s,bias:n,output:a}=e,l=4*W(r),c=5*l+t+l,h=new Float32Array(s.rows*c);for(let d=0;d<s.rows;d++){let m=s.values.subarray(d*s.columns,(d+1)*s.columns),u=d*c;for(let f=0;f<5;f++){let p=m.subarray(f*r,(f+1)*r);h.set(p,u+f*l)}h.set(m.subarray(5*r),u+5*l),h[u+5*l+t-1]=n.values[d];for(let f=0;f<r;f++){let p=u+5*l+t+f;h[p]=a.values[f*a.columns+d]}}return i?hs(h):h}function Rt(e){if(e.decoder.length===0)return new Float32Array(4);let t=4*W(e.decoder[0].weights.rows),i=e.decoder.flatMap(({weights:n,bias:a},l)=>{let c=l<3?t:4;return[Fi(n,c,4*W(n.columns)),Fi(a,c,1)]}),r=new Float32Array(i.reduce((n,a)=>n+a.length,0)),s=0;for(let n of i)r.set(n,s),s+=n.length;return r}function Fi(e,t,i){let r=new Float32Array(t*i);for(let s=0;s<e.rows;s++){let n=e.values.subarray(s*e.columns,(s+1)*e.columns);r.set(n,s*i)}return r}function hs(e){let t=new Uint32Array(e.slice().buffer);return Uint16Array.from(t,i=>{let r=i>>>16&32768,s=i&2147483647;if(s>=1199570944)return r|31744;if(s<855638016)return r;if(s<947912704){let l=126-(s>>>23),c=s&8388607|8388608,h=c>>>l,d=c&(1<<l)-1,m=1<<l-1;return r|h+(d>m||d===m&&h&1?1:0)}let n=s-939524096>>>13,a=s&8191;return r|n+(a>4096||a===4096&&n&1?1:0)})}var us=["maxBufferSize","maxStorageBufferBindingSize","maxTextureDimension3D","maxTextureDimension2D"],ds=65535,at=class e{constructor(t,i,r){this.device=t;this.name=i;this.hasHalf=r;this.lost=t.lost}device;name;hasHalf;lost;modules=new Map;pipelines=new Map;static async open(){if(!("gpu"in navigator))throw new M("This browser has no WebGPU.");let t=await navigator.gpu.requestAdapter({powerPreference:"high-performance"});if(t===null)throw new M("This browser has WebGPU, but finds no GPU that it may use.");let i=t.features.has("shader-f16"),r={};for(let c of us)r[c]=t.limits[c];let s=await t.requestDevice({requiredFeatures:i?["shader-f16"]:[],requiredLimits:r}),{vendor:n,architecture:a,description:l}=t.info;return new e(s,l||`${n} ${a}`.trim()||"a GPU",i)}buffer(t,i,r=0){let s=typeof t=="number"?t:t.byteLength,n=Math.min(this.device.limits.maxStorageBufferBindingSize,this.device.limits.maxBufferSize);if(s>n)throw new M(`${i} takes ${ot(s)}, and this GPU binds at most ${ot(n)}: choose a smaller sequence or less detail.`);let a=this.device.createBuffer({size:Math.max(16,Math.ceil(s/4)*4),usage:GPUBufferUsage.STORAGE|GPUBufferUsage.COPY_DST|GPUBufferUsage.COPY_SRC|r});return typeof t!="number"&&this.write(a,t),a}uniform(t){let i=GPUBufferUsage.UNIFORM|GPUBufferUsage.COPY_DST;return this.device.createBuffer({size:t,usage:i})}write(t,i,r=0){this.device.queue.writeBuffer(t,r,i.buffer,i.byteOffset,i.byteLength)}module(t){let i=this.modules.get(t);return i===void 0&&(i=this.device.createShaderModule({code:t}),this.modules.set(t,i)),i}compute(t,i){let r=`${i}
${t}`,s=this.pipelines.get(r);if(s===void 0){let n={module:this.module(t),entryPoint:i};s=this.device.createComputePipelineAsync({layout:"auto",compute:n}),this.pipelines.set(r,s)}return s}render(t,i,r){let s=this.module(t);return this.device.createRenderPipelineAsync({layout:"auto",vertex:{module:s,entryPoint:"corner"},fragment:{module:s,entryPoint:i,targets:[{format:r}]}})}bound(t,i,r){let s=Object.entries(r).map(([n,a])=>({binding:Number(n),resource:a instanceof GPUBuffer?{buffer:a}:a}));return this.device.createBindGroup({layout:t.getBindGroupLayout(i),entries:s})}submit(t){let i=this.device.createCommandEncoder();t(i),this.device.queue.submit([i.finish()])}async read(t,i=t.size){let r=GPUBufferUsage.COPY_DST|GPUBufferUsage.MAP_READ,s=this.device.createBuffer({size:i,usage:r});this.submit(a=>a.copyBufferToBuffer(t,0,s,0,i)),await s.mapAsync(GPUMapMode.READ);let n=s.getMappedRange().slice(0);return s.destroy(),n}async pixels(t,i){let{width:r,height:s}=t,n=r*i,a=Math.ceil(n/256)*256,l=GPUBufferUsage.COPY_DST|GPUBufferUsage.MAP_READ,c=this.device.createBuffer({size:a*s,usage:l});this.submit(m=>m.copyTextureToBuffer({texture:t},{buffer:c,bytesPerRow:a},{width:r,height:s})),await c.mapAsync(GPUMapMode.READ);let h=new Uint8Array(c.getMappedRange()),d=new Uint8Array(n*s);for(let m=0;m<s;m++)d.set(h.subarray(m*a,m*a+n),m*n);return c.destroy(),d.buffer}};function V(e,t,i,r){let s=e.beginComputePass();if(s.setPipeline(t),i.forEach((n,a)=>s.setBindGroup(a,n)),typeof r=="number"){let n=Math.ceil(r/ds)||1;s.dispatchWorkgroups(Math.ceil(r/n),n)}else s.dispatchWorkgroups(...r);s.end()}function ot(e){return`${Number((e/2**20).toPrecision(3))} MiB`}var Hi=`// The state on the cells of another frame: cells active in both keep theirs, new ones start at zero.

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
`;var ji=`// What the cells of a rule are conditioned on: position, density, velocity, as \`rule/conditioning.py\`.

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
`;var Ki=`// What is seen of a state: the mean over each part of a cell, as \`painting/__init__.py\` paints it.

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
`;var qi=`// What is seen of a state between cells: its first four channels and what three sine layers add.
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
`;var Yi=`// One step: s' = s + m · W2 relu(W1 [perception ‖ priors ‖ 1]), the bias being W1's last column.
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
`;var Wt=class{constructor(t,i){this.lower=t;this.upper=i;this.size=[0,1,2].map(r=>i[r]-t[r]),this.values=new Uint8Array(this.size[0]*this.size[1]*this.size[2])}lower;upper;size;values;at(t,i,r){let[s,n,a]=this.lower;return((t-s)*this.size[1]+(i-n))*this.size[2]+(r-a)}holds(t,i,r){let{lower:s,upper:n}=this;return t>=s[0]&&t<n[0]&&i>=s[1]&&i<n[1]&&r>=s[2]&&r<n[2]}spread(t,i){let{size:r,values:s}=this,n=[r[1]*r[2],r[2],1],a=Uint8Array.from(s,l=>l>0?1:0);for(let l=0;l<3;l++){let c=n[l],h=r[l],d=a.slice();for(let m=0;m<d.length;m++){if(d[m]===0)continue;let u=Math.floor(m/c)%h,f=-Math.min(t,u),p=Math.min(t,h-1-u);for(let b=f;b<=p;b++)a[m+b*c]=1}}for(let l=0;l<s.length;l++)s[l]===0&&a[l]===1&&(s[l]=i)}};function Xi(e,t,i,r,s){let n=e.lower.map(c=>c-r),a=e.upper.map(c=>c+r),l=new Wt(n,a);return s?l.values.fill(1):(ws(l,e,t,255*Math.sqrt(.01*i/e.density)),l.spread(r,1),l.spread(3,2)),ys(l,e)}function ws(e,t,i,r){for(let s=0;s<i.count;s++){let[n,a,l]=[0,1,2].map(c=>8*i.bricks[3*s+c]);for(let c=0;c<512;c++){if(i.planes[512*s+c]<=r)continue;let[h,d,m]=[n+(c>>6),a+(c>>3&7),l+(c&7)];h>=t.lower[0]&&h<t.upper[0]&&d>=t.lower[1]&&d<t.upper[1]&&m>=t.lower[2]&&m<t.upper[2]&&(e.values[e.at(h,d,m)]=1)}}}function ys(e,t){let i=e.lower.map(p=>Math.floor(p/8)),r=e.upper.map((p,b)=>Math.floor((p-1)/8)+1-i[b]),s=new Uint32Array(r[0]*r[1]*r[2]).fill(4294967295),n=[],a=[],l=[],c=[],h=0;for(let p=0;p<r[0];p++)for(let b=0;b<r[1];b++)for(let x=0;x<r[2];x++,h++){let _=[8*(p+i[0]),8*(b+i[1]),8*(x+i[2])];vs(e,t,_,a.length,l,c)&&(s[h]=a.length,a.push(h),n.push(p+i[0],b+i[1],x+i[2]))}let d=a.length,m=s.length+3*d,u=new Uint32Array(m+512*d+l.length+c.length);u.set(s),u.set(Int32Array.from(n),s.length),u.fill(4294967295,m,m+512*d),[l,c].flat().forEach((p,b)=>{u[m+p]=b,u[m+512*d+b]=p});let f=new Int32Array(16);return f.set([...e.lower,l.length,...e.upper,0,...i,d,...r,0]),{cells:l.length,beside:c.length,uniform:f,places:u}}function vs(e,t,[i,r,s],n,a,l){let c=a.length+l.length;for(let h=0;h<512;h++){let[d,m,u]=[i+(h>>6),r+(h>>3&7),s+(h&7)];if(!e.holds(d,m,u))continue;let f=e.values[e.at(d,m,u)];f===1?a.push(512*n+h):f===2&&d>=t.lower[0]&&d<t.upper[0]&&m>=t.lower[1]&&m<t.upper[1]&&u>=t.lower[2]&&u<t.upper[2]&&l.push(512*n+h)}return a.length+l.length>c}function Qi(e,t){let[,,,,,,,,i,r,s,n,a,l,c]=e.uniform,[,,,,,,,,h,d,m,u,f,p,b]=t.uniform,x=a*l*c,A=f*p*b+3*u,z=new Uint32Array(e.cells).fill(4294967295);for(let E=0;E<e.cells;E++){let P=e.places[x+515*n+E],U=x+3*(P>>>9),L=(e.places[U]|0)-h,G=(e.places[U+1]|0)-d,O=(e.places[U+2]|0)-m;if(L<0||G<0||O<0||L>=f||G>=p||O>=b)continue;let Ce=t.places[(L*p+G)*b+O];if(Ce===4294967295)continue;let Z=t.places[A+512*Ce+(P&511)];Z<t.cells&&(z[E]=Z)}return z}var lt=256,Zi=64,ct=class e{constructor(t,i,r,s,n){this.gpu=t;this.rule=i;this.smoke=r;this.pipelines=s;this.isHalf=n;let a=4*W(i.width+1);this.uniform=t.uniform(64),this.steps=t.uniform(lt*Zi),this.filters=t.uniform(864),t.write(this.filters,Di(i.sobel,i.laplacian)),this.weights=t.buffer(Nt(i,a,n),"the rule"),this.network=t.buffer(Rt(i),"the decoder"),this.given=t.uniform(112),this.now=Array.from({length:14},()=>t.uniform(32))}gpu;rule;smoke;pipelines;isHalf;sites=null;stepsDone=0;painted=null;uniform;places=null;state=null;spare=null;told=null;paintedFor=0;steps;filters;weights;network;given;now;static async create(t,i,r,s){let n=s&&t.hasHalf,a=`const PLANES = ${W(i.channels)}u;
`,l=i.decoder.length>0?W(i.decoder[0].weights.rows):0,c=W(i.width+1),h=n?`enable f16;
alias Factor = f16;
`:`alias Factor = f32;
`,d=`const TOLD = ${c}u;
const HIDDEN = ${i.hidden.rows}u;
`,m=`${a}const UNITS4 = ${l}u;
${Y}${qi}${Ki}`,[u,f,p,b,x]=await Promise.all([t.compute(`${h}${a}${d}${Y}${Yi}`,"step"),t.compute(`${Y}${ee}${ji}`,"condition"),t.compute(`${a}${Hi}`,"carry"),t.compute(m,"paint"),t.compute(m,"rim")]);return new e(t,i,r,{step:u,condition:f,carry:p,paint:b,rim:x},n)}learn(t){let i=r=>JSON.stringify([r.channels,r.hidden,r.columns,r.width,r.dilation,r.decoder.length].map(s=>typeof s=="object"&&"values"in s?[s.rows,s.columns]:s));return i(t)!==i(this.rule)?!1:(this.gpu.write(this.weights,Nt(t,4*W(t.width+1),this.isHalf)),this.gpu.write(this.network,Rt(t)),this.rule=t,!0)}enter(t,i){let{gpu:r,rule:s}=this,n=Xi(this.smoke,t.frame,s.density,s.dilation,s.wholeBox),a=r.buffer(n.places,"the list of cells"),l=(n.cells+1)*16*W(s.channels),c=r.buffer(l,"the state");if(this.sites!==null&&this.state!==null&&n.cells>0){let h=r.buffer(Qi(n,this.sites),"the list of cells"),{carry:d}=this.pipelines,m=r.bound(d,0,{0:h,1:this.state,2:c});r.submit(u=>V(u,d,[m],Math.ceil(n.cells/64))),h.destroy()}this.release(),r.write(this.uniform,n.uniform),this.sites=n,this.places=a,this.state=c,this.spare=r.buffer(l,"the state"),this.told=r.buffer(n.cells*16*W(s.width+1),"the conditioning"),this.condition(t,i)}condition(t,i){let{gpu:r,rule:s,sites:n}=this;if(n===null||n.cells===0)return;let a=new ArrayBuffer(112),l=new Float32Array(a),c=this.placeMatrix();for(let p=0;p<16;p++)l[p]=c[p%4][p>>2];let{position:h=-1,density:d=-1,velocity:m=-1}=s.columns;new Int32Array(a).set([h,d,m,4*W(s.width+1)],16),l.set([s.density,s.speed],20),l.set([...this.alongCells(i.direction),i.amount],24),r.write(this.given,l);let{condition:u}=this.pipelines,f=[r.bound(u,0,{0:this.uniform,1:this.places}),r.bound(u,1,{0:this.given,1:this.told}),r.bound(u,2,{0:t.uniform,1:t.bytes})];r.submit(p=>V(p,u,f,Math.ceil(n.cells/64)))}alongCells(t){let i=me(this.smoke.toWorld),r=[0,1,2].map(n=>t.reduce((a,l,c)=>a+i[n][c]*l,0)),s=Math.hypot(...r)||1;return r.map(n=>n/s)}placeMatrix(){let{place:t,dilation:i}=this.rule,r=[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]],s=this.smoke.lower.map(a=>a-i),n=this.smoke.upper.map(a=>a+i);if(t!==null){let a=Ai(me(t.toWorld),this.smoke.toWorld);this.isNear(a,t.lower,t.upper)&&([r,s,n]=[a,t.lower,t.upper])}return r.map((a,l)=>{if(l===3)return a;let c=2/(n[l]-s[l]),h=a.map(d=>d*c);return h[3]+=(1-2*s[l])/(n[l]-s[l])-1,h})}isNear(t,i,r){let s=[1/0,1/0,1/0],n=[-1/0,-1/0,-1/0];for(let a=0;a<8;a++){let l=[0,1,2].map(c=>(a>>c&1?this.smoke.upper:this.smoke.lower)[c]-.5);for(let c=0;c<3;c++){let[h,d,m,u]=t[c],f=h*l[0]+d*l[1]+m*l[2]+u;s[c]=Math.min(s[c],f),n[c]=Math.max(n[c],f)}}return[0,1,2].every(a=>n[a]>i[a]-.5&&s[a]<r[a]-.5)}step(t,i){let{gpu:r,rule:s,sites:n}=this;for(let a=0;a<t;){let l=Math.min(Zi,t-a),c=new Uint32Array(lt/4*l);for(let h=0;h<l;h++){let d=$i(i,this.stepsDone+a+h),m=s.probability>=1?1:0;c.set([d,Oi(s.probability),m,0],lt/4*h)}r.write(this.steps,c),n!==null&&n.cells>0&&this.submitSteps(l),a+=l}this.stepsDone+=t}submitSteps(t){let{gpu:i,sites:r}=this,{step:s}=this.pipelines;i.submit(n=>{for(let a=0;a<t;a++){let l=i.bound(s,0,{0:this.uniform,1:this.places,2:{buffer:this.steps,offset:lt*a,size:16},3:this.filters,4:this.weights,5:this.told,6:this.state,7:this.spare});V(n,s,[l],Math.ceil(r.cells/256)),[this.state,this.spare]=[this.spare,this.state]}})}get shown(){return this.sites===null?0:this.sites.cells+this.sites.beside}paint(t,i){let{gpu:r,rule:s,sites:n}=this;if(n===null)return;let a=(n.cells+n.beside)*t**3;if((this.painted===null||this.paintedFor!==a)&&(this.painted?.destroy(),this.painted=r.buffer(16*a,"the painting"),this.paintedFor=a),a===0)return;let{paint:l,rim:c}=this.pipelines,h=[n.cells,...Array(3*t+1).fill(n.beside)];h.forEach((u,f)=>{let p=new Int32Array([t,i,Math.max(f-1,0),u,s.dilation,0,0,0]);r.write(this.now[f],p)});let d={0:this.uniform,1:this.places},m=[r.bound(l,0,d),r.bound(l,1,{0:this.network}),r.bound(l,2,{0:this.now[0],1:this.state,2:this.painted})];r.submit(u=>{let f=p=>Math.ceil(p*t**3/64);n.cells>0&&V(u,l,m,f(n.cells));for(let p=1;p<h.length&&n.beside>0;p++){let b=[r.bound(c,0,d),r.bound(c,1,{}),r.bound(c,2,{0:this.now[p],2:this.painted})];V(u,c,b,f(n.beside))}})}reset(){this.release(),this.sites=null,this.stepsDone=0}release(){for(let t of[this.places,this.state,this.spare,this.told,this.painted])t?.destroy();this.places=this.state=this.spare=this.told=this.painted=null,this.paintedFor=0}destroy(){this.release();let t=[this.uniform,this.steps,this.filters,this.weights,this.network,this.given];for(let i of[...t,...this.now])i.destroy()}};var Vt=`// How much smoke lies between each place and the light, as \`rendering/light.py\` finds it: layer by
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
`;var er=`// Emission and absorption along the rays of a camera, as \`rendering/\` adds them up: samples lie at
// whole multiples of a step from the eye, and colour is the quotient of what is interpolated.

struct Camera {
  eye: vec4f,        // In cells of what is drawn; w: their number in a cell of the smoke.
  middle: vec4f,     // The direction of the picture's middle, for a length of depth; w: the step.
  right: vec4f,      // What is added to it for a picture's height to the right; w: aspect,
  up: vec4f,         // and for one up; w: γ times the step.
  size: vec4f,       // Of what is drawn, in cells; w: how much of the picture, from the left.
  blocks: vec4f,     // The first block of the light, in cells; w: cells along an edge of a block.
  light: vec4f,      // glow, strength, ambient, and 1 where there is a light.
  octaves: vec4f,    // Their weights over what faces the light.
}

// Where a file has no brick there is no smoke within a cell (\`viewer/smoke_file.py\`): rays leap.

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

// The brick of the cell of the box that is nearest to a place, in bricks: smoke fades over the cell
// beside the box.
fn brick_of(cell: vec3f) -> vec3i {
  let parts = camera.eye.w;
  let coarse = vec3i(floor((cell - 0.5) / parts)) + smoke.lower;
  return clamp(coarse, smoke.lower, smoke.upper - 1) >> vec3u(3);
}

fn is_stored(brick: vec3i) -> bool {
  let at = brick - smoke.first;
  if (any(at < vec3i(0)) || any(at >= smoke.span)) {
    return false;
  }
  return bytes[u32((at.x * smoke.span.y + at.y) * smoke.span.z + at.z)] != NONE;
}

// The depth at which a ray leaves a brick.
fn leaving(brick: vec3i, way: vec3f) -> f32 {
  let low = vec3f(8 * brick - smoke.lower) * camera.eye.w + 0.5;
  let far = select(low, low + 8.0 * camera.eye.w, way > vec3f(0.0));
  let depth = (far - camera.eye.xyz) / way;
  return min(depth.x, min(depth.y, depth.z));
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
    let brick = brick_of(cell);
    if (!is_stored(brick)) {
      k = max(k, ceil(leaving(brick, way) / step) - 1.0);
      continue;
    }
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
`;var tr=`// What is drawn: density, and colour times density, at every cell of the box and one beside it.

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
`;var Es=96,rr=[[.5,1],[.3,1/4],[.2,1/16]],Ts=rr.reduce((e,[t,i])=>e+t/(1+i),0),Ps=2**27,Gt="rgba16float",Be=class e{constructor(t,i,r){this.gpu=t;this.smoke=i;this.pipelines=r;this.looks=[0,1].map(()=>t.uniform(32)),this.camera=t.uniform(128),this.sampler=t.device.createSampler({magFilter:"linear",minFilter:"linear"}),this.nothing=this.texture([1,1,1])}gpu;smoke;pipelines;parts=0;size=[];textures=[];buffers=null;drawn=null;reached=null;blocks=null;thickness=null;depth=null;looks;camera;sampler;nothing;static async create(t,i){let[r,s,n,a]=await Promise.all([t.compute(`${Y}${ee}${tr}`,"volume"),t.compute(Vt,"gather"),t.compute(Vt,"sweep"),t.render(`${ee}${er}`,"march",Gt)]);return new e(t,i,{volume:r,gather:s,sweep:n,march:a})}refine(t){if(t===this.parts)return;this.release();let{lower:i,upper:r}=this.smoke;this.size=i.map((a,l)=>(r[l]-a)*t+2);let s=this.gpu.device.limits.maxTextureDimension3D,n=this.size.reduce((a,l)=>a*l,1);if(Math.max(...this.size)>s||n>Ps){let a=this.size.join(" × ");throw new M(`A volume of ${a} (${ot(8*n)}) is more than this page draws: choose a smaller sequence or less detail.`)}this.parts=t,this.textures=[0,1].map(()=>this.texture(this.size)),this.makeBlocks()}makeBlocks(){let{gpu:t,smoke:i,parts:r}=this,[s,n]=Ms(i,r),a=Math.max(...s.map((u,f)=>n[f]-u))/Es,l=Math.max(Math.round(a),1),c=i.lower.map(u=>Math.floor(u*r/l)-1),h=i.upper.map(u=>Math.floor((u*r-1)/l)+1),d=c.map((u,f)=>h[f]-u+1),m=d.reduce((u,f)=>u*f,1);this.reached=this.texture(d),this.thickness=t.buffer(4*m,"the light"),this.depth=t.buffer(4*m,"the light"),this.blocks={first:c,size:d,times:l,slots:t.uniform(256*Math.max(...d))}}texture(t){return this.gpu.device.createTexture({size:t,dimension:"3d",format:"rgba16float",usage:GPUTextureUsage.TEXTURE_BINDING|GPUTextureUsage.STORAGE_BINDING|GPUTextureUsage.COPY_SRC})}draw(t,i,r,s){this.buffers=t;let n=this.nothing;i.forEach((a,l)=>{let c=new ArrayBuffer(32),h=s.isPlain?1:0;new Int32Array(c).set([this.parts,h,l>0?1:0]);let{mixed:d,strength:m,densityStrength:u}=s,f=s.isPlain?0:u;new Float32Array(c).set([d,m,f,a.rule.density],3),this.gpu.write(this.looks[l],new Uint8Array(c)),n=this.drawLayer(t,a,l,r,n)}),this.drawn=n,s.light.strength>0&&this.shine(s)}drawLayer(t,i,r,s,n){let{gpu:a}=this,{volume:l}=this.pipelines,c=this.textures[r],h=[a.bound(l,0,{0:i.uniform,1:i.places}),a.bound(l,1,{0:this.looks[r],1:i.painted,2:s,3:n.createView(),4:c.createView()}),a.bound(l,2,{0:t.uniform,1:t.bytes})];return a.submit(d=>V(d,l,h,ir(this.size))),c}shine({light:t,gamma:i}){let{gpu:r,parts:s}=this,{gather:n,sweep:a}=this.pipelines,{first:l,size:c,times:h,slots:d}=this.blocks,[,,m]=D(t.azimuth,t.elevation),u=R(ht(this.smoke,R(m,-1)),1/h),f=u.map(Math.abs).reduce((E,P,U,L)=>P>L[E]?U:E,0),p=[0,1,2].filter(E=>E!==f),b=p.map(E=>u[E]/Math.abs(u[f])),x=.5/Math.abs(u[f])*i/s,_=this.smoke.lower.map(E=>E*s-1),A=new ArrayBuffer(256*c[f]);for(let E=0;E<c[f];E++){let P=new Int32Array(A,256*E,16),U=new Float32Array(A,256*E,16);P.set([...l,f,...c,h,..._,u[f]>0?1:0]),U.set([...b,x],12),P[15]=E}r.write(d,new Uint8Array(A));let z=E=>({buffer:d,offset:256*E,size:64});r.submit(E=>{let P={1:this.drawn.createView(),2:this.thickness};V(E,n,[r.bound(n,0,{0:z(0),...P})],ir(c));let[U,L]=p.map(G=>Math.ceil(c[G]/8));for(let G=0;G<c[f];G++){let O=r.bound(a,0,{0:z(G),2:this.thickness,3:this.depth,4:this.reached.createView()});V(E,a,[O],[U,L,1])}})}take(t,i,r,s,n,[a,l]=[0,1],c=!0){let{gpu:h,parts:d}=this,m=i.width/i.height,u=2*ae(r.fieldOfView),[f,p,b]=D(r.azimuth,r.elevation),x=Z=>ht(this.smoke,Z),{light:_}=s,A=Math.max(1-_.strength,0),z=this.blocks,E=z.first.map((Z,ts)=>(Z+.5)*z.times-.5-this.smoke.lower[ts]*d+1),P=new Float32Array([...this.place(st(r)),d,...x(b),n,...x(R(f,u)),m,...x(R(p,u)),s.gamma/d*n,...this.size,0,...E,z.times,A,_.strength,_.ambient,_.strength>0?1:0,...rr.map(([Z])=>Z/Ts),0]);h.write(this.camera,P);let{march:U}=this.pipelines,L=t.beginRenderPass({colorAttachments:[{view:i.createView(),loadOp:c?"clear":"load",storeOp:"store",clearValue:[0,0,0,0]}]});L.setPipeline(U);let G=h.bound(U,0,{0:this.camera,1:this.drawn.createView(),2:this.reached.createView(),3:this.sampler});L.setBindGroup(0,G),L.setBindGroup(1,h.bound(U,1,{})),L.setBindGroup(2,h.bound(U,2,{0:this.buffers.uniform,1:this.buffers.bytes}));let O=Math.round(a*i.width),Ce=Math.round(l*i.width)-O;Ce>0&&(L.setScissorRect(O,0,Ce,i.height),L.draw(3)),L.end()}place(t){return Lt(me(this.smoke.toWorld),t).map((r,s)=>(r+.5)*this.parts-.5-this.smoke.lower[s]*this.parts+1)}get texture3d(){return this.drawn}get cells(){return this.size}get refinement(){return this.parts}release(){for(let t of this.textures)t.destroy();for(let t of[this.reached,this.thickness,this.depth,this.blocks?.slots])t?.destroy()}destroy(){this.release();for(let t of[this.camera,this.nothing,...this.looks])t.destroy()}};function ht(e,t){return R(Ui(me(e.toWorld),t),sr(e))}function sr(e){return Math.hypot(...[0,1,2].map(t=>e.toWorld[t][0]))}function Ms(e,t){let i=sr(e)/t,[r,s]=Ft(e,e.toWorld);return[R(r,1/i),R(s,1/i)]}function Ft(e,t){let i=Array.from({length:8},(s,n)=>{let a=[0,1,2].map(l=>(n>>l&1?e.upper:e.lower)[l]-.5);return Lt(t,a)}),r=s=>[0,1,2].map(n=>s(...i.map(a=>a[n])));return[r(Math.min),r(Math.max)]}function ir(e){return e.map(t=>Math.ceil(t/4))}var pe={seed:0,steps:0,warmup:64,strength:1,densityStrength:1,density:1,exposure:0,light:1.2,lightAzimuth:-55,lightElevation:40,ambient:.15,guide:0,guideAzimuth:0,guideElevation:90,mix:0,wipe:2,detail:1,brush:5,half:0},As=30,nr=.5,ar={1:3,2:2,3:2,4:2},Us=[.005181516702338386,.005181516702338386,.006995410187265387],ut=class e{constructor(t,i,r,s,n,a){this.gpu=t;this.smoke=i;this.painting=r;this.plain=s;this.pipelines=n;this.format=a;let l=i.lower.map((c,h)=>i.upper[h]-c);this.brushed=t.buffer(4*l[0]*l[1]*l[2],"the mix of two rules"),this.brush=t.uniform(64),this.hit=t.buffer(16,"a point"),this.screen=t.uniform(32),this.sampler=t.device.createSampler({magFilter:"linear",minFilter:"linear"}),this.camera=this.framed(1)}gpu;smoke;painting;plain;pipelines;format;settings={...pe};camera;at=-1;layers=[];samples=0;buffers=null;stale={state:!0,look:!0};picture=null;brushed;brush;hit;screen;sampler;static async create(t,i,r){let s=`const PLANES = 1u;
${Y}${ee}${It}`,[n,a,l,c,h]=await Promise.all([Be.create(t,i),Be.create(t,i),t.compute(s,"meet"),t.compute(s,"blend"),t.render(Vi,"present",r)]);return new e(t,i,n,a,{meet:l,blend:c,present:h},r)}framed(t,i=0,r=5){let[s,n]=Ft(this.smoke,this.smoke.toWorld);return zi(s,n,i,r,t,As)}async use(t,i){let r=this.settings.half>0,s=t===null?null:await ct.create(this.gpu,t,this.smoke,r);this.layers[i]?.destroy(),s===null?this.layers.length=i:(this.layers[i]=s,this.buffers!==null&&this.begin(s)),this.stale.state=!0}get guide(){let{guide:t,guideAzimuth:i,guideElevation:r}=this.settings,[,,s]=D(i,-r);return{direction:s,amount:t}}begin(t){t.enter(this.buffers,this.guide),this.frameSteps(t,this.settings.warmup)}frameSteps(t,i){let r=this.settings.steps||t.rule.steps;t.step(i+r,this.settings.seed)}async show(t){this.enterFrame(await this.smoke.frame(t),t)}enterFrame(t,i){this.release(),this.buffers=this.upload(t),this.at=i;for(let r of this.layers){let s=r.sites===null||r.sites.cells===0;r.enter(this.buffers,this.guide),this.frameSteps(r,s?this.settings.warmup:0)}this.stale.state=!0,i+1<this.smoke.length&&this.smoke.frame(i+1).catch(()=>{})}async restart(){for(let t of this.layers)t.reset();this.gpu.write(this.brushed,new Float32Array(this.brushed.size/4)),await this.show(0)}upload(t){let{gpu:i,smoke:r}=this,s=r.lower.map(u=>Math.floor(u/8)),n=r.upper.map((u,f)=>Math.floor((u-1)/8)+1-s[f]),a=new Uint32Array(n[0]*n[1]*n[2]).fill(4294967295);for(let u=0;u<t.count;u++){let[f,p,b]=[0,1,2].map(x=>t.bricks[3*u+x]-s[x]);a[(f*n[1]+p)*n[2]+b]=u}let l=new Uint8Array(a.byteLength+t.planes.length);l.set(new Uint8Array(a.buffer)),l.set(t.planes,a.byteLength);let c=new ArrayBuffer(64),h=new Int32Array(c),d=new Float32Array(c);h.set(r.lower),d[3]=r.density,h.set(r.upper,4),d[7]=r.speed,h.set([...s,t.count,...n],8);let m=i.uniform(64);return i.write(m,new Uint8Array(c)),{frame:t,uniform:m,bytes:i.buffer(l,"the smoke")}}step(t){for(let i of this.layers)i.step(t,this.settings.seed);this.stale.state=!0}conditionAgain(){if(this.buffers!==null)for(let t of this.layers)t.condition(this.buffers,this.guide)}lookAgain(){this.stale.look=!0}look(t=!1){let i=this.settings,[r]=this.layers;return{strength:t?0:i.strength,densityStrength:i.densityStrength,gamma:r.rule.gamma*i.density,light:{strength:i.light,azimuth:i.lightAzimuth,elevation:i.lightElevation,ambient:i.ambient},isPlain:t,mixed:i.mix}}get parts(){if(!this.layers.every(s=>s.rule.decoder.length>0))return 1;let t=this.gpu.device.limits.maxStorageBufferBindingSize,i=Math.max(...this.layers.map(s=>s.shown)),r=this.settings.detail;for(;r>1&&16*i*r**3>t;)r--;return r}prepare(){if(this.buffers===null||this.layers.length===0)return;let{parts:t}=this;if(t!==this.painting.refinement&&(this.stale.state=!0),this.stale.state){let i=this.samples||ar[t];for(let r of this.layers)r.paint(t,Math.min(i,ar[t]))}if((this.stale.state||this.stale.look)&&(this.painting.refine(t),this.painting.draw(this.buffers,this.layers,this.brushed,this.look()),this.settings.wipe<1)){this.plain.refine(1);let[i]=this.layers;this.plain.draw(this.buffers,[i],this.brushed,this.look(!0))}this.stale={state:!1,look:!1}}take(t,i){this.prepare(),(this.picture?.width!==t||this.picture.height!==i)&&(this.picture?.destroy(),this.picture=this.gpu.device.createTexture({size:[t,i],format:Gt,usage:GPUTextureUsage.RENDER_ATTACHMENT|GPUTextureUsage.TEXTURE_BINDING|GPUTextureUsage.COPY_SRC}));let r=this.picture;if(this.buffers===null||this.layers.length===0)return r;let s=Math.min(this.settings.wipe,1);return this.gpu.submit(n=>{let{camera:a}=this;this.painting.take(n,r,a,this.look(),nr,[0,s]),s<1&&this.plain.take(n,r,a,this.look(!0),nr,[s,1],!1)}),r}present(t,i,r,s){let{present:n}=this.pipelines,a=this.settings,l=a.light>0?1:0,c=[...Us,l,2**a.exposure,a.wipe,r,s];this.gpu.write(this.screen,new Float32Array(c)),this.gpu.submit(h=>{let d=h.beginRenderPass({colorAttachments:[{view:i,loadOp:"clear",storeOp:"store",clearValue:[0,0,0,1]}]});d.setPipeline(n);let m=this.gpu.bound(n,0,{0:this.screen,1:t.createView(),2:this.sampler});d.setBindGroup(0,m),d.draw(3),d.end()})}async pixels(t,i){let r=this.take(t,i),{device:s}=this.gpu,n=GPUTextureUsage.RENDER_ATTACHMENT|GPUTextureUsage.COPY_SRC,a=s.createTexture({size:[t,i],format:this.format,usage:n});this.present(r,a.createView(),t,i);let l=new Uint8ClampedArray(await this.gpu.pixels(a,4));if(a.destroy(),this.format==="bgra8unorm")for(let c=0;c<l.length;c+=4)[l[c],l[c+2]]=[l[c+2],l[c]];return l}async touch(t,[i,r],s){if(this.buffers===null||this.layers.length===0)return;this.prepare();let{gpu:n,smoke:a}=this,[l,c,h]=D(this.camera.azimuth,this.camera.elevation),d=2*ae(this.camera.fieldOfView),m=N(N(h,l,i*s*d),c,r*d),u=ht(a,R(m,1/Math.hypot(...m))),{parts:f}=this,p=this.look().gamma/f;n.write(this.brush,new Float32Array([...this.painting.place(st(this.camera)),this.settings.brush,...u,p,...this.painting.cells,f,t==="less"?-.5:.5,0,0,0]));let{meet:b}=this.pipelines,x=this.painting.texture3d.createView(),_=n.bound(b,1,{0:this.brush,1:x,2:this.hit});n.submit(A=>V(A,b,[n.bound(b,0,{}),_],1)),t==="erase"?await this.erase():this.blend()}async erase(){let{gpu:t}=this;for(let i of this.layers){let r=`const PLANES = ${W(i.rule.channels)}u;
`,s=await t.compute(`${r}${Y}${ee}${It}`,"erase");if(i.sites===null||i.sites.cells===0||this.buffers===null)continue;let n=[t.bound(s,0,{0:i.uniform,1:i.places}),t.bound(s,1,{0:this.brush,2:this.hit,3:i.state}),t.bound(s,2,{0:this.buffers.uniform})],a=i.sites.cells;t.submit(l=>V(l,s,n,Math.ceil(a/64)))}this.stale.state=!0}blend(){let{gpu:t,smoke:i}=this,{blend:r}=this.pipelines,s=i.lower.map((a,l)=>Math.ceil((i.upper[l]-a)/4)),n=[t.bound(r,0,{}),t.bound(r,1,{0:this.brush,2:this.hit,4:this.brushed}),t.bound(r,2,{0:this.buffers.uniform})];t.submit(a=>V(a,r,n,s)),this.stale.look=!0}release(){this.buffers?.uniform.destroy(),this.buffers?.bytes.destroy(),this.buffers=null}destroy(){this.release();for(let t of this.layers)t.destroy();this.painting.destroy(),this.plain.destroy();for(let t of[this.picture,this.brushed,this.brush,this.hit,this.screen])t?.destroy()}};var or=Object.keys(pe),lr=["azimuth","elevation","distance"],Ls={detail:[1,4],strength:[0,1],densityStrength:[0,1],steps:[0,256],warmup:[0,4096],density:[.001,1e3],light:[0,20],ambient:[0,1],half:[0,1]};function cr(e){let t=new URLSearchParams,{settings:i,camera:r,at:s}=e.stage;e.names[0]!==e.show.rules[0].name&&t.set("rule",e.names[0]),e.names[1]&&t.set("with",e.names[1]);for(let a of or)e.isDefault(a)||t.set(a,$t(i[a]));for(let a of lr)t.set(a,$t(r[a]));t.set("target",r.target.map($t).join(",")),s>0&&t.set("frame",String(s));let n=new URL(location.href);return n.hash=t.toString(),n.href}async function Ot(e,t){let i=new URLSearchParams(t.replace(/^#/,"")),r=h=>{let d=Number(i.get(h));return i.has(h)&&Number.isFinite(d)?d:null},{settings:s,camera:n}=e.stage;for(let h of or){let d=r(h);if(d===null)continue;let[m,u]=Ls[h]??[-1e6,1e6];s[h]=Math.min(Math.max(d,m),u)}s.detail=Math.round(s.detail);for(let h of lr){let d=r(h);d!==null&&(h!=="distance"||d>0)&&(n[h]=d)}let a=(i.get("target")??"").split(",").map(Number);a.length===3&&a.every(Number.isFinite)&&(n.target=a);let l=h=>e.show.rules.some(d=>d.name===h)?h:null;await e.use(l(i.get("rule"))??e.show.rules[0].name,0);let c=l(i.get("with"));c!==null&&await e.use(c,1),await e.goTo(Math.round(r("frame")??0))}function $t(e){return String(Number(e.toPrecision(6)))}var ti=(e,t,i)=>{if(!t.has(e))throw TypeError("Cannot "+i)},o=(e,t,i)=>(ti(e,t,"read from private field"),i?i.call(e):t.get(e)),g=(e,t,i)=>{if(t.has(e))throw TypeError("Cannot add the same private member more than once");t instanceof WeakSet?t.add(e):t.set(e,i)},k=(e,t,i,r)=>(ti(e,t,"write to private field"),r?r.call(e,i):t.set(e,i),i),w=(e,t,i)=>(ti(e,t,"access private method"),i),ur=class{constructor(e){this.value=e}},ii=class{constructor(e){this.value=e}},dr=e=>e<256?1:e<65536?2:e<1<<24?3:e<2**32?4:e<2**40?5:6,Cs=e=>{if(e<127)return 1;if(e<16383)return 2;if(e<(1<<21)-1)return 3;if(e<(1<<28)-1)return 4;if(e<2**35-1)return 5;if(e<2**42-1)return 6;throw new Error("EBML VINT size not supported "+e)},ge=(e,t,i)=>{let r=0;for(let s=t;s<i;s++){let n=Math.floor(s/8),a=e[n],l=7-(s&7),c=(a&1<<l)>>l;r<<=1,r|=c}return r},zs=(e,t,i,r)=>{for(let s=t;s<i;s++){let n=Math.floor(s/8),a=e[n],l=7-(s&7);a&=~(1<<l),a|=(r&1<<i-s-1)>>i-s-1<<l,e[n]=a}};var Et=class{},ri=class extends Et{constructor(){super(...arguments),this.buffer=null}},fr=class extends Et{constructor(e){if(super(),this.options=e,typeof e!="object")throw new TypeError("StreamTarget requires an options object to be passed to its constructor.");if(e.onData){if(typeof e.onData!="function")throw new TypeError("options.onData, when provided, must be a function.");if(e.onData.length<2)throw new TypeError("options.onData, when provided, must be a function that takes in at least two arguments (data and position). Ignoring the position argument, which specifies the byte offset at which the data is to be written, can lead to broken outputs.")}if(e.onHeader&&typeof e.onHeader!="function")throw new TypeError("options.onHeader, when provided, must be a function.");if(e.onCluster&&typeof e.onCluster!="function")throw new TypeError("options.onCluster, when provided, must be a function.");if(e.chunked!==void 0&&typeof e.chunked!="boolean")throw new TypeError("options.chunked, when provided, must be a boolean.");if(e.chunkSize!==void 0&&(!Number.isInteger(e.chunkSize)||e.chunkSize<1024))throw new TypeError("options.chunkSize, when provided, must be an integer and not smaller than 1024.")}},Bs=class extends Et{constructor(e,t){if(super(),this.stream=e,this.options=t,!(e instanceof FileSystemWritableFileStream))throw new TypeError("FileSystemWritableFileStreamTarget requires a FileSystemWritableFileStream instance.");if(t!==void 0&&typeof t!="object")throw new TypeError("FileSystemWritableFileStreamTarget's options, when provided, must be an object.");if(t&&t.chunkSize!==void 0&&(!Number.isInteger(t.chunkSize)||t.chunkSize<=0))throw new TypeError("options.chunkSize, when provided, must be a positive integer")}},re,T,Dt,mr,Ht,pr,jt,gr,dt,Kt,qt,br,wr=class{constructor(){g(this,Dt),g(this,Ht),g(this,jt),g(this,dt),g(this,qt),this.pos=0,g(this,re,new Uint8Array(8)),g(this,T,new DataView(o(this,re).buffer)),this.offsets=new WeakMap,this.dataOffsets=new WeakMap}seek(e){this.pos=e}writeEBMLVarInt(e,t=Cs(e)){let i=0;switch(t){case 1:o(this,T).setUint8(i++,128|e);break;case 2:o(this,T).setUint8(i++,64|e>>8),o(this,T).setUint8(i++,e);break;case 3:o(this,T).setUint8(i++,32|e>>16),o(this,T).setUint8(i++,e>>8),o(this,T).setUint8(i++,e);break;case 4:o(this,T).setUint8(i++,16|e>>24),o(this,T).setUint8(i++,e>>16),o(this,T).setUint8(i++,e>>8),o(this,T).setUint8(i++,e);break;case 5:o(this,T).setUint8(i++,8|e/2**32&7),o(this,T).setUint8(i++,e>>24),o(this,T).setUint8(i++,e>>16),o(this,T).setUint8(i++,e>>8),o(this,T).setUint8(i++,e);break;case 6:o(this,T).setUint8(i++,4|e/2**40&3),o(this,T).setUint8(i++,e/2**32|0),o(this,T).setUint8(i++,e>>24),o(this,T).setUint8(i++,e>>16),o(this,T).setUint8(i++,e>>8),o(this,T).setUint8(i++,e);break;default:throw new Error("Bad EBML VINT size "+t)}this.write(o(this,re).subarray(0,i))}writeEBML(e){if(e!==null)if(e instanceof Uint8Array)this.write(e);else if(Array.isArray(e))for(let t of e)this.writeEBML(t);else if(this.offsets.set(e,this.pos),w(this,dt,Kt).call(this,e.id),Array.isArray(e.data)){let t=this.pos,i=e.size===-1?1:e.size??4;e.size===-1?w(this,Dt,mr).call(this,255):this.seek(this.pos+i);let r=this.pos;if(this.dataOffsets.set(e,r),this.writeEBML(e.data),e.size!==-1){let s=this.pos-r,n=this.pos;this.seek(t),this.writeEBMLVarInt(s,i),this.seek(n)}}else if(typeof e.data=="number"){let t=e.size??dr(e.data);this.writeEBMLVarInt(t),w(this,dt,Kt).call(this,e.data,t)}else typeof e.data=="string"?(this.writeEBMLVarInt(e.data.length),w(this,qt,br).call(this,e.data)):e.data instanceof Uint8Array?(this.writeEBMLVarInt(e.data.byteLength,e.size),this.write(e.data)):e.data instanceof ur?(this.writeEBMLVarInt(4),w(this,Ht,pr).call(this,e.data.value)):e.data instanceof ii&&(this.writeEBMLVarInt(8),w(this,jt,gr).call(this,e.data.value))}};re=new WeakMap;T=new WeakMap;Dt=new WeakSet;mr=function(e){o(this,T).setUint8(0,e),this.write(o(this,re).subarray(0,1))};Ht=new WeakSet;pr=function(e){o(this,T).setFloat32(0,e,!1),this.write(o(this,re).subarray(0,4))};jt=new WeakSet;gr=function(e){o(this,T).setFloat64(0,e,!1),this.write(o(this,re))};dt=new WeakSet;Kt=function(e,t=dr(e)){let i=0;switch(t){case 6:o(this,T).setUint8(i++,e/2**40|0);case 5:o(this,T).setUint8(i++,e/2**32|0);case 4:o(this,T).setUint8(i++,e>>24);case 3:o(this,T).setUint8(i++,e>>16);case 2:o(this,T).setUint8(i++,e>>8);case 1:o(this,T).setUint8(i++,e);break;default:throw new Error("Bad UINT size "+t)}this.write(o(this,re).subarray(0,i))};qt=new WeakSet;br=function(e){this.write(new Uint8Array(e.split("").map(t=>t.charCodeAt(0))))};var ft,de,je,mt,Yt,Is=class extends wr{constructor(e){super(),g(this,mt),g(this,ft,void 0),g(this,de,new ArrayBuffer(2**16)),g(this,je,new Uint8Array(o(this,de))),k(this,ft,e)}write(e){w(this,mt,Yt).call(this,this.pos+e.byteLength),o(this,je).set(e,this.pos),this.pos+=e.byteLength}finalize(){w(this,mt,Yt).call(this,this.pos),o(this,ft).buffer=o(this,de).slice(0,this.pos)}};ft=new WeakMap;de=new WeakMap;je=new WeakMap;mt=new WeakSet;Yt=function(e){let t=o(this,de).byteLength;for(;t<e;)t*=2;if(t===o(this,de).byteLength)return;let i=new ArrayBuffer(t),r=new Uint8Array(i);r.set(o(this,je),0),k(this,de,i),k(this,je,r)};var be,H,j,oe,Je=class extends wr{constructor(e){super(),this.target=e,g(this,be,!1),g(this,H,void 0),g(this,j,void 0),g(this,oe,void 0)}write(e){if(!o(this,be))return;let t=this.pos;if(t<o(this,j)){if(t+e.byteLength<=o(this,j))return;e=e.subarray(o(this,j)-t),t=0}let i=t+e.byteLength-o(this,j),r=o(this,H).byteLength;for(;r<i;)r*=2;if(r!==o(this,H).byteLength){let s=new Uint8Array(r);s.set(o(this,H),0),k(this,H,s)}o(this,H).set(e,t-o(this,j)),k(this,oe,Math.max(o(this,oe),t+e.byteLength))}startTrackingWrites(){k(this,be,!0),k(this,H,new Uint8Array(2**10)),k(this,j,this.pos),k(this,oe,this.pos)}getTrackedWrites(){if(!o(this,be))throw new Error("Can't get tracked writes since nothing was tracked.");let t={data:o(this,H).subarray(0,o(this,oe)-o(this,j)),start:o(this,j),end:o(this,oe)};return k(this,H,void 0),k(this,be,!1),t}};be=new WeakMap;H=new WeakMap;j=new WeakMap;oe=new WeakMap;var Ns=2**24,Rs=2,le,ke,Ve,Ie,J,F,wt,Xt,si,yr,ni,vr,Ge,yt,ai=class extends Je{constructor(e,t){super(e),g(this,wt),g(this,si),g(this,ni),g(this,Ge),g(this,le,[]),g(this,ke,0),g(this,Ve,void 0),g(this,Ie,void 0),g(this,J,void 0),g(this,F,[]),k(this,Ve,t),k(this,Ie,e.options?.chunked??!1),k(this,J,e.options?.chunkSize??Ns)}write(e){super.write(e),o(this,le).push({data:e.slice(),start:this.pos}),this.pos+=e.byteLength}flush(){if(o(this,le).length===0)return;let e=[],t=[...o(this,le)].sort((i,r)=>i.start-r.start);e.push({start:t[0].start,size:t[0].data.byteLength});for(let i=1;i<t.length;i++){let r=e[e.length-1],s=t[i];s.start<=r.start+r.size?r.size=Math.max(r.size,s.start+s.data.byteLength-r.start):e.push({start:s.start,size:s.data.byteLength})}for(let i of e){i.data=new Uint8Array(i.size);for(let r of o(this,le))i.start<=r.start&&r.start<i.start+i.size&&i.data.set(r.data,r.start-i.start);if(o(this,Ie))w(this,wt,Xt).call(this,i.data,i.start),w(this,Ge,yt).call(this);else{if(o(this,Ve)&&i.start<o(this,ke))throw new Error("Internal error: Monotonicity violation.");this.target.options.onData?.(i.data,i.start),k(this,ke,i.start+i.data.byteLength)}}o(this,le).length=0}finalize(){o(this,Ie)&&w(this,Ge,yt).call(this,!0)}};le=new WeakMap;ke=new WeakMap;Ve=new WeakMap;Ie=new WeakMap;J=new WeakMap;F=new WeakMap;wt=new WeakSet;Xt=function(e,t){let i=o(this,F).findIndex(l=>l.start<=t&&t<l.start+o(this,J));i===-1&&(i=w(this,ni,vr).call(this,t));let r=o(this,F)[i],s=t-r.start,n=e.subarray(0,Math.min(o(this,J)-s,e.byteLength));r.data.set(n,s);let a={start:s,end:s+n.byteLength};if(w(this,si,yr).call(this,r,a),r.written[0].start===0&&r.written[0].end===o(this,J)&&(r.shouldFlush=!0),o(this,F).length>Rs){for(let l=0;l<o(this,F).length-1;l++)o(this,F)[l].shouldFlush=!0;w(this,Ge,yt).call(this)}n.byteLength<e.byteLength&&w(this,wt,Xt).call(this,e.subarray(n.byteLength),t+n.byteLength)};si=new WeakSet;yr=function(e,t){let i=0,r=e.written.length-1,s=-1;for(;i<=r;){let n=Math.floor(i+(r-i+1)/2);e.written[n].start<=t.start?(i=n+1,s=n):r=n-1}for(e.written.splice(s+1,0,t),(s===-1||e.written[s].end<t.start)&&s++;s<e.written.length-1&&e.written[s].end>=e.written[s+1].start;)e.written[s].end=Math.max(e.written[s].end,e.written[s+1].end),e.written.splice(s+1,1)};ni=new WeakSet;vr=function(e){let i={start:Math.floor(e/o(this,J))*o(this,J),data:new Uint8Array(o(this,J)),written:[],shouldFlush:!1};return o(this,F).push(i),o(this,F).sort((r,s)=>r.start-s.start),o(this,F).indexOf(i)};Ge=new WeakSet;yt=function(e=!1){for(let t=0;t<o(this,F).length;t++){let i=o(this,F)[t];if(!(!i.shouldFlush&&!e)){for(let r of i.written){if(o(this,Ve)&&i.start+r.start<o(this,ke))throw new Error("Internal error: Monotonicity violation.");this.target.options.onData?.(i.data.subarray(r.start,r.end),i.start+r.start),k(this,ke,i.start+r.end)}o(this,F).splice(t--,1)}}};var Ws=class extends ai{constructor(e,t){super(new fr({onData:(i,r)=>e.stream.write({type:"write",data:i,position:r}),chunked:!0,chunkSize:e.options?.chunkSize}),t)}},_e=1,Ke=2,vt=3,Vs=1,Gs=2,Fs=17,$s=2**15,Fe=2**13,hr="webm-muxer",kr=6,xr=5,Os=["strict","offset","permissive"],v,y,qe,Ye,Q,Ae,we,fe,Ue,se,xe,Se,q,Ze,Ee,te,ie,ce,$e,Oe,Te,Pe,kt,Xe,De,Qt,Sr,Jt,Er,oi,Tr,li,Pr,ci,Mr,hi,_r,ui,Ar,Tt,di,Pt,fi,mi,Ur,he,ye,ue,ve,Zt,Lr,ei,Cr,Ne,pt,Re,gt,pi,zr,K,X,Me,Qe,He,xt,gi,Br,St,bi,We,bt,Ir=class{constructor(e){g(this,Qt),g(this,Jt),g(this,oi),g(this,li),g(this,ci),g(this,hi),g(this,ui),g(this,Tt),g(this,Pt),g(this,mi),g(this,he),g(this,ue),g(this,Zt),g(this,ei),g(this,Ne),g(this,Re),g(this,pi),g(this,K),g(this,Me),g(this,He),g(this,gi),g(this,St),g(this,We),g(this,v,void 0),g(this,y,void 0),g(this,qe,void 0),g(this,Ye,void 0),g(this,Q,void 0),g(this,Ae,void 0),g(this,we,void 0),g(this,fe,void 0),g(this,Ue,void 0),g(this,se,void 0),g(this,xe,void 0),g(this,Se,void 0),g(this,q,void 0),g(this,Ze,void 0),g(this,Ee,0),g(this,te,[]),g(this,ie,[]),g(this,ce,[]),g(this,$e,void 0),g(this,Oe,void 0),g(this,Te,-1),g(this,Pe,-1),g(this,kt,-1),g(this,Xe,void 0),g(this,De,!1),w(this,Qt,Sr).call(this,e),k(this,v,{type:"webm",firstTimestampBehavior:"strict",...e}),this.target=e.target;let t=!!o(this,v).streaming;if(e.target instanceof ri)k(this,y,new Is(e.target));else if(e.target instanceof fr)k(this,y,new ai(e.target,t));else if(e.target instanceof Bs)k(this,y,new Ws(e.target,t));else throw new Error(`Invalid target: ${e.target}`);w(this,Jt,Er).call(this)}addVideoChunk(e,t,i){if(!(e instanceof EncodedVideoChunk))throw new TypeError("addVideoChunk's first argument (chunk) must be of type EncodedVideoChunk.");if(t&&typeof t!="object")throw new TypeError("addVideoChunk's second argument (meta), when provided, must be an object.");if(i!==void 0&&(!Number.isFinite(i)||i<0))throw new TypeError("addVideoChunk's third argument (timestamp), when provided, must be a non-negative real number.");let r=new Uint8Array(e.byteLength);e.copyTo(r),this.addVideoChunkRaw(r,e.type,i??e.timestamp,t)}addVideoChunkRaw(e,t,i,r){if(!(e instanceof Uint8Array))throw new TypeError("addVideoChunkRaw's first argument (data) must be an instance of Uint8Array.");if(t!=="key"&&t!=="delta")throw new TypeError("addVideoChunkRaw's second argument (type) must be either 'key' or 'delta'.");if(!Number.isFinite(i)||i<0)throw new TypeError("addVideoChunkRaw's third argument (timestamp) must be a non-negative real number.");if(r&&typeof r!="object")throw new TypeError("addVideoChunkRaw's fourth argument (meta), when provided, must be an object.");if(w(this,We,bt).call(this),!o(this,v).video)throw new Error("No video track declared.");o(this,$e)===void 0&&k(this,$e,i),r&&w(this,Zt,Lr).call(this,r);let s=w(this,Re,gt).call(this,e,t,i,_e);for(o(this,v).video.codec==="V_VP9"&&w(this,ei,Cr).call(this,s),k(this,Te,s.timestamp);o(this,ie).length>0&&o(this,ie)[0].timestamp<=s.timestamp;){let n=o(this,ie).shift();w(this,K,X).call(this,n,!1)}!o(this,v).audio||s.timestamp<=o(this,Pe)?w(this,K,X).call(this,s,!0):o(this,te).push(s),w(this,Ne,pt).call(this),w(this,he,ye).call(this)}addAudioChunk(e,t,i){if(!(e instanceof EncodedAudioChunk))throw new TypeError("addAudioChunk's first argument (chunk) must be of type EncodedAudioChunk.");if(t&&typeof t!="object")throw new TypeError("addAudioChunk's second argument (meta), when provided, must be an object.");if(i!==void 0&&(!Number.isFinite(i)||i<0))throw new TypeError("addAudioChunk's third argument (timestamp), when provided, must be a non-negative real number.");let r=new Uint8Array(e.byteLength);e.copyTo(r),this.addAudioChunkRaw(r,e.type,i??e.timestamp,t)}addAudioChunkRaw(e,t,i,r){if(!(e instanceof Uint8Array))throw new TypeError("addAudioChunkRaw's first argument (data) must be an instance of Uint8Array.");if(t!=="key"&&t!=="delta")throw new TypeError("addAudioChunkRaw's second argument (type) must be either 'key' or 'delta'.");if(!Number.isFinite(i)||i<0)throw new TypeError("addAudioChunkRaw's third argument (timestamp) must be a non-negative real number.");if(r&&typeof r!="object")throw new TypeError("addAudioChunkRaw's fourth argument (meta), when provided, must be an object.");if(w(this,We,bt).call(this),!o(this,v).audio)throw new Error("No audio track declared.");o(this,Oe)===void 0&&k(this,Oe,i),r?.decoderConfig&&(o(this,v).streaming?k(this,se,w(this,Me,Qe).call(this,r.decoderConfig.description)):w(this,He,xt).call(this,o(this,se),r.decoderConfig.description));let s=w(this,Re,gt).call(this,e,t,i,Ke);for(k(this,Pe,s.timestamp);o(this,te).length>0&&o(this,te)[0].timestamp<=s.timestamp;){let n=o(this,te).shift();w(this,K,X).call(this,n,!0)}!o(this,v).video||s.timestamp<=o(this,Te)?w(this,K,X).call(this,s,!o(this,v).video):o(this,ie).push(s),w(this,Ne,pt).call(this),w(this,he,ye).call(this)}addSubtitleChunk(e,t,i){if(typeof e!="object"||!e)throw new TypeError("addSubtitleChunk's first argument (chunk) must be an object.");if(!(e.body instanceof Uint8Array))throw new TypeError("body must be an instance of Uint8Array.");if(!Number.isFinite(e.timestamp)||e.timestamp<0)throw new TypeError("timestamp must be a non-negative real number.");if(!Number.isFinite(e.duration)||e.duration<0)throw new TypeError("duration must be a non-negative real number.");if(e.additions&&!(e.additions instanceof Uint8Array))throw new TypeError("additions, when present, must be an instance of Uint8Array.");if(typeof t!="object")throw new TypeError("addSubtitleChunk's second argument (meta) must be an object.");if(w(this,We,bt).call(this),!o(this,v).subtitles)throw new Error("No subtitle track declared.");t?.decoderConfig&&(o(this,v).streaming?k(this,xe,w(this,Me,Qe).call(this,t.decoderConfig.description)):w(this,He,xt).call(this,o(this,xe),t.decoderConfig.description));let r=w(this,Re,gt).call(this,e.body,"key",i??e.timestamp,vt,e.duration,e.additions);k(this,kt,r.timestamp),o(this,ce).push(r),w(this,Ne,pt).call(this),w(this,he,ye).call(this)}finalize(){if(o(this,De))throw new Error("Cannot finalize a muxer more than once.");for(;o(this,te).length>0;)w(this,K,X).call(this,o(this,te).shift(),!0);for(;o(this,ie).length>0;)w(this,K,X).call(this,o(this,ie).shift(),!0);for(;o(this,ce).length>0&&o(this,ce)[0].timestamp<=o(this,Ee);)w(this,K,X).call(this,o(this,ce).shift(),!1);if(o(this,q)&&w(this,St,bi).call(this),o(this,y).writeEBML(o(this,Se)),!o(this,v).streaming){let e=o(this,y).pos,t=o(this,y).pos-o(this,ue,ve);o(this,y).seek(o(this,y).offsets.get(o(this,qe))+4),o(this,y).writeEBMLVarInt(t,kr),o(this,we).data=new ii(o(this,Ee)),o(this,y).seek(o(this,y).offsets.get(o(this,we))),o(this,y).writeEBML(o(this,we)),o(this,Q).data[0].data[1].data=o(this,y).offsets.get(o(this,Se))-o(this,ue,ve),o(this,Q).data[1].data[1].data=o(this,y).offsets.get(o(this,Ye))-o(this,ue,ve),o(this,Q).data[2].data[1].data=o(this,y).offsets.get(o(this,Ae))-o(this,ue,ve),o(this,y).seek(o(this,y).offsets.get(o(this,Q))),o(this,y).writeEBML(o(this,Q)),o(this,y).seek(e)}w(this,he,ye).call(this),o(this,y).finalize(),k(this,De,!0)}};v=new WeakMap;y=new WeakMap;qe=new WeakMap;Ye=new WeakMap;Q=new WeakMap;Ae=new WeakMap;we=new WeakMap;fe=new WeakMap;Ue=new WeakMap;se=new WeakMap;xe=new WeakMap;Se=new WeakMap;q=new WeakMap;Ze=new WeakMap;Ee=new WeakMap;te=new WeakMap;ie=new WeakMap;ce=new WeakMap;$e=new WeakMap;Oe=new WeakMap;Te=new WeakMap;Pe=new WeakMap;kt=new WeakMap;Xe=new WeakMap;De=new WeakMap;Qt=new WeakSet;Sr=function(e){if(typeof e!="object")throw new TypeError("The muxer requires an options object to be passed to its constructor.");if(!(e.target instanceof Et))throw new TypeError("The target must be provided and an instance of Target.");if(e.video){if(typeof e.video.codec!="string")throw new TypeError(`Invalid video codec: ${e.video.codec}. Must be a string.`);if(!Number.isInteger(e.video.width)||e.video.width<=0)throw new TypeError(`Invalid video width: ${e.video.width}. Must be a positive integer.`);if(!Number.isInteger(e.video.height)||e.video.height<=0)throw new TypeError(`Invalid video height: ${e.video.height}. Must be a positive integer.`);if(e.video.frameRate!==void 0&&(!Number.isFinite(e.video.frameRate)||e.video.frameRate<=0))throw new TypeError(`Invalid video frame rate: ${e.video.frameRate}. Must be a positive number.`);if(e.video.alpha!==void 0&&typeof e.video.alpha!="boolean")throw new TypeError(`Invalid video alpha: ${e.video.alpha}. Must be a boolean.`)}if(e.audio){if(typeof e.audio.codec!="string")throw new TypeError(`Invalid audio codec: ${e.audio.codec}. Must be a string.`);if(!Number.isInteger(e.audio.numberOfChannels)||e.audio.numberOfChannels<=0)throw new TypeError(`Invalid number of audio channels: ${e.audio.numberOfChannels}. Must be a positive integer.`);if(!Number.isInteger(e.audio.sampleRate)||e.audio.sampleRate<=0)throw new TypeError(`Invalid audio sample rate: ${e.audio.sampleRate}. Must be a positive integer.`);if(e.audio.bitDepth!==void 0&&(!Number.isInteger(e.audio.bitDepth)||e.audio.bitDepth<=0))throw new TypeError(`Invalid audio bit depth: ${e.audio.bitDepth}. Must be a positive integer.`)}if(e.subtitles&&typeof e.subtitles.codec!="string")throw new TypeError(`Invalid subtitles codec: ${e.subtitles.codec}. Must be a string.`);if(e.type!==void 0&&!["webm","matroska"].includes(e.type))throw new TypeError(`Invalid type: ${e.type}. Must be 'webm' or 'matroska'.`);if(e.firstTimestampBehavior&&!Os.includes(e.firstTimestampBehavior))throw new TypeError(`Invalid first timestamp behavior: ${e.firstTimestampBehavior}`);if(e.streaming!==void 0&&typeof e.streaming!="boolean")throw new TypeError(`Invalid streaming option: ${e.streaming}. Must be a boolean.`)};Jt=new WeakSet;Er=function(){o(this,y)instanceof Je&&o(this,y).target.options.onHeader&&o(this,y).startTrackingWrites(),w(this,oi,Tr).call(this),o(this,v).streaming||w(this,hi,_r).call(this),w(this,ui,Ar).call(this),w(this,li,Pr).call(this),w(this,ci,Mr).call(this),o(this,v).streaming||(w(this,Tt,di).call(this),w(this,Pt,fi).call(this)),w(this,mi,Ur).call(this),w(this,he,ye).call(this)};oi=new WeakSet;Tr=function(){let e={id:440786851,data:[{id:17030,data:1},{id:17143,data:1},{id:17138,data:4},{id:17139,data:8},{id:17026,data:o(this,v).type??"webm"},{id:17031,data:2},{id:17029,data:2}]};o(this,y).writeEBML(e)};li=new WeakSet;Pr=function(){k(this,Ue,{id:236,size:4,data:new Uint8Array(Fe)}),k(this,se,{id:236,size:4,data:new Uint8Array(Fe)}),k(this,xe,{id:236,size:4,data:new Uint8Array(Fe)})};ci=new WeakSet;Mr=function(){k(this,fe,{id:21936,data:[{id:21937,data:2},{id:21946,data:2},{id:21947,data:2},{id:21945,data:0}]})};hi=new WeakSet;_r=function(){let e=new Uint8Array([28,83,187,107]),t=new Uint8Array([21,73,169,102]),i=new Uint8Array([22,84,174,107]);k(this,Q,{id:290298740,data:[{id:19899,data:[{id:21419,data:e},{id:21420,size:5,data:0}]},{id:19899,data:[{id:21419,data:t},{id:21420,size:5,data:0}]},{id:19899,data:[{id:21419,data:i},{id:21420,size:5,data:0}]}]})};ui=new WeakSet;Ar=function(){let e={id:17545,data:new ii(0)};k(this,we,e);let t={id:357149030,data:[{id:2807729,data:1e6},{id:19840,data:hr},{id:22337,data:hr},o(this,v).streaming?null:e]};k(this,Ye,t)};Tt=new WeakSet;di=function(){let e={id:374648427,data:[]};k(this,Ae,e),o(this,v).video&&e.data.push({id:174,data:[{id:215,data:_e},{id:29637,data:_e},{id:131,data:Vs},{id:134,data:o(this,v).video.codec},o(this,Ue),o(this,v).video.frameRate?{id:2352003,data:1e9/o(this,v).video.frameRate}:null,{id:224,data:[{id:176,data:o(this,v).video.width},{id:186,data:o(this,v).video.height},o(this,v).video.alpha?{id:21440,data:1}:null,o(this,fe)]}]}),o(this,v).audio&&(k(this,se,o(this,v).streaming?o(this,se)||null:{id:236,size:4,data:new Uint8Array(Fe)}),e.data.push({id:174,data:[{id:215,data:Ke},{id:29637,data:Ke},{id:131,data:Gs},{id:134,data:o(this,v).audio.codec},o(this,se),{id:225,data:[{id:181,data:new ur(o(this,v).audio.sampleRate)},{id:159,data:o(this,v).audio.numberOfChannels},o(this,v).audio.bitDepth?{id:25188,data:o(this,v).audio.bitDepth}:null]}]})),o(this,v).subtitles&&e.data.push({id:174,data:[{id:215,data:vt},{id:29637,data:vt},{id:131,data:Fs},{id:134,data:o(this,v).subtitles.codec},o(this,xe)]})};Pt=new WeakSet;fi=function(){let e={id:408125543,size:o(this,v).streaming?-1:kr,data:[o(this,v).streaming?null:o(this,Q),o(this,Ye),o(this,Ae)]};if(k(this,qe,e),o(this,y).writeEBML(e),o(this,y)instanceof Je&&o(this,y).target.options.onHeader){let{data:t,start:i}=o(this,y).getTrackedWrites();o(this,y).target.options.onHeader(t,i)}};mi=new WeakSet;Ur=function(){k(this,Se,{id:475249515,data:[]})};he=new WeakSet;ye=function(){o(this,y)instanceof ai&&o(this,y).flush()};ue=new WeakSet;ve=function(){return o(this,y).dataOffsets.get(o(this,qe))};Zt=new WeakSet;Lr=function(e){if(e.decoderConfig){if(e.decoderConfig.colorSpace){let t=e.decoderConfig.colorSpace;if(k(this,Xe,t),o(this,fe).data=[{id:21937,data:{rgb:1,bt709:1,bt470bg:5,smpte170m:6}[t.matrix]},{id:21946,data:{bt709:1,smpte170m:6,"iec61966-2-1":13}[t.transfer]},{id:21947,data:{bt709:1,bt470bg:5,smpte170m:6}[t.primaries]},{id:21945,data:[1,2][Number(t.fullRange)]}],!o(this,v).streaming){let i=o(this,y).pos;o(this,y).seek(o(this,y).offsets.get(o(this,fe))),o(this,y).writeEBML(o(this,fe)),o(this,y).seek(i)}}e.decoderConfig.description&&(o(this,v).streaming?k(this,Ue,w(this,Me,Qe).call(this,e.decoderConfig.description)):w(this,He,xt).call(this,o(this,Ue),e.decoderConfig.description))}};ei=new WeakSet;Cr=function(e){if(e.type!=="key"||!o(this,Xe))return;let t=0;if(ge(e.data,0,2)!==2)return;t+=2;let i=(ge(e.data,t+1,t+2)<<1)+ge(e.data,t+0,t+1);t+=2,i===3&&t++;let r=ge(e.data,t+0,t+1);if(t++,r)return;let s=ge(e.data,t+0,t+1);if(t++,s!==0)return;t+=2;let n=ge(e.data,t+0,t+24);if(t+=24,n!==4817730)return;i>=2&&t++;let a={rgb:7,bt709:2,bt470bg:1,smpte170m:3}[o(this,Xe).matrix];zs(e.data,t+0,t+3,a)};Ne=new WeakSet;pt=function(){let e=Math.min(o(this,v).video?o(this,Te):1/0,o(this,v).audio?o(this,Pe):1/0),t=o(this,ce);for(;t.length>0&&t[0].timestamp<=e;)w(this,K,X).call(this,t.shift(),!o(this,v).video&&!o(this,v).audio)};Re=new WeakSet;gt=function(e,t,i,r,s,n){let a=w(this,pi,zr).call(this,i,r);return{data:e,additions:n,type:t,timestamp:a,duration:s,trackNumber:r}};pi=new WeakSet;zr=function(e,t){let i=t===_e?o(this,Te):t===Ke?o(this,Pe):o(this,kt);if(t!==vt){let r=t===_e?o(this,$e):o(this,Oe);if(o(this,v).firstTimestampBehavior==="strict"&&i===-1&&e!==0)throw new Error(`The first chunk for your media track must have a timestamp of 0 (received ${e}). Non-zero first timestamps are often caused by directly piping frames or audio data from a MediaStreamTrack into the encoder. Their timestamps are typically relative to the age of the document, which is probably what you want.

If you want to offset all timestamps of a track such that the first one is zero, set firstTimestampBehavior: 'offset' in the options.
If you want to allow non-zero first timestamps, set firstTimestampBehavior: 'permissive'.
`);o(this,v).firstTimestampBehavior==="offset"&&(e-=r)}if(e<i)throw new Error(`Timestamps must be monotonically increasing (went from ${i} to ${e}).`);if(e<0)throw new Error(`Timestamps must be non-negative (received ${e}).`);return e};K=new WeakSet;X=function(e,t){o(this,v).streaming&&!o(this,Ae)&&(w(this,Tt,di).call(this),w(this,Pt,fi).call(this));let i=Math.floor(e.timestamp/1e3),r=i-o(this,Ze),s=t&&e.type==="key"&&r>=1e3,n=r>=$s;if((!o(this,q)||s||n)&&(w(this,gi,Br).call(this,i),r=0),r<0)return;let a=new Uint8Array(4),l=new DataView(a.buffer);if(l.setUint8(0,128|e.trackNumber),l.setInt16(1,r,!1),e.duration===void 0&&!e.additions){l.setUint8(3,+(e.type==="key")<<7);let c={id:163,data:[a,e.data]};o(this,y).writeEBML(c)}else{let c=Math.floor(e.duration/1e3),h={id:160,data:[{id:161,data:[a,e.data]},e.duration!==void 0?{id:155,data:c}:null,e.additions?{id:30113,data:e.additions}:null]};o(this,y).writeEBML(h)}k(this,Ee,Math.max(o(this,Ee),i))};Me=new WeakSet;Qe=function(e){return{id:25506,size:4,data:new Uint8Array(e)}};He=new WeakSet;xt=function(e,t){let i=o(this,y).pos;o(this,y).seek(o(this,y).offsets.get(e));let r=6+t.byteLength,s=Fe-r;if(s<0){let n=t.byteLength+s;t instanceof ArrayBuffer?t=t.slice(0,n):t=t.buffer.slice(0,n),s=0}e=[w(this,Me,Qe).call(this,t),{id:236,size:4,data:new Uint8Array(s)}],o(this,y).writeEBML(e),o(this,y).seek(i)};gi=new WeakSet;Br=function(e){o(this,q)&&w(this,St,bi).call(this),o(this,y)instanceof Je&&o(this,y).target.options.onCluster&&o(this,y).startTrackingWrites(),k(this,q,{id:524531317,size:o(this,v).streaming?-1:xr,data:[{id:231,data:e}]}),o(this,y).writeEBML(o(this,q)),k(this,Ze,e);let t=o(this,y).offsets.get(o(this,q))-o(this,ue,ve);o(this,Se).data.push({id:187,data:[{id:179,data:e},o(this,v).video?{id:183,data:[{id:247,data:_e},{id:241,data:t}]}:null,o(this,v).audio?{id:183,data:[{id:247,data:Ke},{id:241,data:t}]}:null]})};St=new WeakSet;bi=function(){if(!o(this,v).streaming){let e=o(this,y).pos-o(this,y).dataOffsets.get(o(this,q)),t=o(this,y).pos;o(this,y).seek(o(this,y).offsets.get(o(this,q))+4),o(this,y).writeEBMLVarInt(e,xr),o(this,y).seek(t)}if(o(this,y)instanceof Je&&o(this,y).target.options.onCluster){let{data:e,start:t}=o(this,y).getTrackedWrites();o(this,y).target.options.onCluster(e,t,o(this,Ze))}};We=new WeakSet;bt=function(){if(o(this,De))throw new Error("Cannot add new video or audio chunks after the file has been finalized.")};var Ds=/(?:(\d{2}):)?(\d{2}):(\d{2}).(\d{3})/;var Xa=new TextEncoder,Hs,js,Ks,qs,Ys,Xs,Qs,Js,Zs;Hs=new WeakMap;js=new WeakMap;Ks=new WeakMap;qs=new WeakMap;Ys=new WeakMap;Xs=new WeakSet;Qs=function(e){let t=Ds.exec(e);if(!t)throw new Error("Expected match.");return 3600*1e3*Number(t[1]||"0")+60*1e3*Number(t[2])+1e3*Number(t[3])+Number(t[4])};Js=new WeakSet;Zs=function(e){let t=Math.floor(e/36e5),i=Math.floor(e%(3600*1e3)/(60*1e3)),r=Math.floor(e%(60*1e3)/1e3),s=e%1e3;return t.toString().padStart(2,"0")+":"+i.toString().padStart(2,"0")+":"+r.toString().padStart(2,"0")+"."+s.toString().padStart(3,"0")};var en=[["vp09.00.40.08","V_VP9"],["vp8","V_VP8"]],Nr=12e6,tn=24;function Rr({canvas:e}){let t=i=>2*Math.max(Math.round(i/2),8);return[t(e.width),t(e.height)]}async function Wr(e,t,i){return new ImageData(await e.stage.pixels(t,i),t,i)}async function Vr(e){let[t,i]=Rr(e),r=new OffscreenCanvas(t,i);return r.getContext("2d").putImageData(await Wr(e,t,i),0,0),r.convertToBlob({type:"image/png"})}async function Gr(e,t){if(!("VideoEncoder"in globalThis))throw new M("This browser encodes no films.");let[i,r]=Rr(e),s=e.smoke.fps*e.speed,[n,a]=await rn(i,r,s),l=new ri,c={codec:a,width:i,height:r,frameRate:s},h=new Ir({target:l,video:c}),d=null,m=new VideoEncoder({output:(u,f)=>h.addVideoChunk(u,f),error:u=>d=u});m.configure({codec:n,width:i,height:r,framerate:s,bitrate:Nr});for(let u=0;u<e.smoke.length;u++){u===0?await e.restart():await e.goTo(u);let f=Math.round(1e6*u/s),p=await Wr(e,i,r),b=new VideoFrame(p.data,{format:"RGBA",codedWidth:i,codedHeight:r,timestamp:f,duration:Math.round(1e6/s)});if(m.encode(b,{keyFrame:u%tn===0}),b.close(),d!==null)throw d;t((u+1)/e.smoke.length)}return await m.flush(),h.finalize(),new Blob([l.buffer],{type:"video/webm"})}async function rn(e,t,i){for(let r of en){let s={codec:r[0],width:e,height:t,framerate:i,bitrate:Nr};if((await VideoEncoder.isConfigSupported(s)).supported)return r}throw new M("This browser encodes no WebM films.")}function wi(e,t,i){let r=t.names.filter(Boolean).join("_"),s=i==="png"?`_${t.smoke.number(Math.max(t.stage.at,0))}`:"";_i(e,`${t.smoke.name}_${r}${s}.${i}`.replace(/[^\w.-]+/g,"_"))}var ne={orbit:"M12 4a8 8 0 1 0 8 8M20 4v5h-5",erase:"M4 15l8.5-8.5 6 6L12 19H8zM9 10l6 6M8 19h12",more:"M12 4v16M4 12h16",less:"M4 12h16",beside:"M4 5h16v14H4zM12 5v14",alive:"M3 12h4l3-7 4 14 3-7h4",picture:"M4 7h4l1.5-2h5L16 7h4v12H4zM12 16.5a3.5 3.5 0 1 0 0-7 3.5 3.5 0 0 0 0 7z",film:"M4 6h11v12H4zM15 10.5l5-3v9l-5-3z",link:"M10 14a4 4 0 0 0 6 0l3-3a4 4 0 0 0-6-6l-1 1M14 10a4 4 0 0 0-6 0l-3 3a4 4 0 0 0 6 6l1-1",home:"M4 11l8-7 8 7M6 10v9h12v-9",settings:"M4 8h9M17 8h3M4 16h3M11 16h9M15 6v4M9 14v4"},sn=[["orbit","Turn, pan and zoom (1)"],["erase","Erase the painting; it heals (2)"],["more","Brush the second style on (3)"],["less","Brush the second style off (4)"]];function Fr(e){let t=sn.map(([n,a])=>{let l=$(a,ne[n],()=>Le(e,n));return l.id=`tool-${n}`,[n,l]}),i=$("Beside the plain smoke (B)",ne.beside,()=>vi(e)),r=$("Goes on while nothing plays (L)",ne.alive,()=>ki(e)),s=()=>{for(let[n,a]of t)a.setAttribute("aria-pressed",String(e.tool===n));i.setAttribute("aria-pressed",String(e.stage.settings.wipe<1)),r.setAttribute("aria-pressed",String(e.isAlive)),e.canvas.dataset.tool=e.tool};return e.addEventListener("change",s),s(),S("div",{id:"tools",role:"toolbar","aria-label":"Tools"},...t.map(([,n])=>n),S("hr"),i,r,$("Frame the smoke (F)",ne.home,()=>e.reframe()),S("hr"),$("Save a picture (P)",ne.picture,()=>{xi(e)}),$("Save a film",ne.film,()=>{nn(e)}),$("Copy a link to what is seen (C)",ne.link,()=>{Si(e)}),$("Settings (H)",ne.settings,yi))}function yi(){document.body.classList.toggle("bare")}function Le(e,t){e.tool=t,e.changed()}function vi(e){e.set("wipe",e.stage.settings.wipe<1?2:.5)}function ki(e){e.isAlive=!e.isAlive,e.changed()}async function xi(e){try{wi(await Vr(e),e,"png")}catch(t){I(B(t))}}async function nn(e){let t=e.isAlive;e.pause(),e.isAlive=!1;try{let i=await Gr(e,r=>I(`Filming: ${Math.round(100*r)} %`));wi(i,e,"webm")}catch(i){I(B(i))}finally{e.isAlive=t}}async function Si(e){let t=cr(e);history.replaceState(null,"",t);try{await navigator.clipboard.writeText(t),I("The link is copied.")}catch{I("The link is in the address bar.")}}var $r="M8 5.5v13l11-6.5z",an="M8 5.5v13M16 5.5v13",on="M18 6.5v11L9 12zM6.5 6.5v11",Ei=[.25,.5,1,2];function Or(e){let t=e.smoke.length-1,i=$("Play (space)",$r,()=>{Ti(e)});i.id="play";let r=S("input",{type:"range",min:0,max:Math.max(t,1),step:1,id:"scrub","aria-label":"Frame"});r.disabled=t<1;let s=S("output",{id:"frame"}),n=S("button",{type:"button",id:"speed",title:"Speed"});n.addEventListener("click",()=>{let c=(Ei.indexOf(e.speed)+1)%Ei.length;e.speed=Ei[c],e.changed()});let a=!1;r.addEventListener("input",async()=>{if(!a){for(a=!0,e.pause();e.stage.at!==Number(r.value);)await e.goTo(Number(r.value));a=!1}});let l=()=>{let c=Math.max(e.stage.at,0);a||(r.value=String(c)),r.style.setProperty("--part",`${100*c/Math.max(t,1)}%`),s.textContent=String(e.smoke.number(c)),n.textContent=`${e.speed}×`,i.querySelector("path").setAttribute("d",e.isPlaying?an:$r),i.classList.toggle("playing",e.isPlaying)};return e.addEventListener("change",l),e.addEventListener("frame",l),l(),S("div",{id:"transport",role:"group","aria-label":"Play"},$("From the beginning (R)",on,()=>{e.restart()}),i,r,s,n)}async function Ti(e){e.isPlaying?e.pause():await e.play()}var ln="Space plays · ← → frames · arrows with Shift turn · + − zoom · 1–4 brushes · N next style · B beside plain smoke · L alive · F frame · P picture · C link · H settings";function Dr(e){let t={" ":()=>{Ti(e)},r:()=>{e.restart()},f:()=>e.reframe(),b:()=>vi(e),l:()=>ki(e),p:()=>{xi(e)},c:()=>{Si(e)},h:yi,n:()=>{cn(e)},"?":()=>I(ln),1:()=>Le(e,"orbit"),2:()=>Le(e,"erase"),3:()=>Le(e,"more"),4:()=>Le(e,"less"),"+":()=>e.look(i=>ze(i,.9,0,1/0)),"-":()=>e.look(i=>ze(i,1.1,0,1/0)),ArrowLeft:i=>Mt(e,i,-1,0),ArrowRight:i=>Mt(e,i,1,0),ArrowUp:i=>Mt(e,i,0,1),ArrowDown:i=>Mt(e,i,0,-1)};document.addEventListener("keydown",i=>{let r=i.target instanceof HTMLInputElement||i.target instanceof HTMLSelectElement;if(i.ctrlKey||i.metaKey||i.altKey||r)return;let s=t[i.key.length===1?i.key.toLowerCase():i.key];s!==void 0&&(i.preventDefault(),s(i))})}function Mt(e,t,i,r){t.shiftKey||r!==0?e.look(s=>zt(s,4*i,4*r)):(e.pause(),e.goTo(e.stage.at+i))}async function cn(e){let{rules:t}=e.show,i=t.findIndex(r=>r.name===e.names[0]);await e.use(t[(i+1)%t.length].name,0)}var hn=[["Paint",[{name:"strength",label:"Colour",low:0,high:1,step:.01,hint:"From white smoke to the colours of the style"},{name:"densityStrength",label:"Density change",low:0,high:1,step:.01,hint:"How much the style thins and thickens the smoke"},{name:"density",label:"Opacity",low:.02,high:20,step:.01,log:!0,unit:"×",hint:"Extinction γ, as a multiple of the style's own"},{name:"steps",label:"Steps a frame",low:0,high:64,step:1,hint:"How long the rule works between two frames; 0 is as in its training"},{name:"detail",label:"Detail",low:1,high:3,step:1,unit:"×",hint:"Parts of a cell that are drawn, as by --refine"},{name:"half",label:"16-bit steps",low:0,high:1,step:1,hint:"Quicker, and a little rounder"},{name:"seed",label:"Seed",low:0,high:99,step:1,hint:"Another seed, another painting of the same style"}]],["Light",[{name:"light",label:"Light",low:0,high:3,step:.05,hint:"0: the smoke glows by itself"},{name:"lightAzimuth",label:"Around",low:-180,high:180,step:1,unit:"°",hint:"Where the light stands"},{name:"lightElevation",label:"Above",low:-90,high:90,step:1,unit:"°",hint:"How high it stands"},{name:"ambient",label:"Shadows",low:0,high:1,step:.01,hint:"How bright shadows are"},{name:"exposure",label:"Exposure",low:-3,high:3,step:.05,unit:" EV",hint:"Brightness of the picture"}]],["Guide",[{name:"guide",label:"Pull",low:0,high:1,step:.01,hint:"How much the pattern follows this direction instead of the smoke's motion"},{name:"guideAzimuth",label:"Around",low:-180,high:180,step:1,unit:"°",hint:"Direction of the pull"},{name:"guideElevation",label:"Up",low:-90,high:90,step:1,unit:"°",hint:"Direction of the pull"}]],["Brush and mix",[{name:"mix",label:"Second style",low:0,high:1,step:.01,hint:"How much of the second style is seen"},{name:"brush",label:"Brush",low:1,high:24,step:.5,unit:" cells",hint:"Radius of the brushes"}]]];function Hr(e){let t=S("aside",{id:"panel","aria-label":"Settings"}),i=[];for(let[s,n]of hn){let a=S("details",{open:s!=="Guide"},S("summary",{},s));for(let l of n)l.name==="half"&&!e.gpu.hasHalf||a.append(un(e,l,i));t.append(a)}let r=()=>i.forEach(s=>s());return e.addEventListener("change",r),r(),t}function un(e,t,i){let{name:r,label:s,low:n,high:a,step:l,log:c=!1,unit:h="",hint:d}=t,m=S("input",{type:"range",min:c?Math.log(n):n,max:c?Math.log(a):a,step:c?"any":l,"aria-label":s,id:`set-${r}`}),u=S("output",{});m.addEventListener("input",()=>{let b=Number(m.value);e.set(r,c?Number(Math.exp(b).toPrecision(3)):b)});let p=S("label",{class:"slider",title:d,ondblclick:()=>{e.set(r,e.show.settings[r]??e.defaults[r])}},S("span",{},s),u,m);return i.push(()=>{let b=e.stage.settings[r],x=c?Math.log(b):b;Number(m.value)!==x&&(m.value=String(x));let _=Number(m.min),A=(x-_)/(Number(m.max)-_);m.style.setProperty("--part",`${100*Math.min(Math.max(A,0),1)}%`),u.textContent=dn(e,r,b,h),p.classList.toggle("changed",!e.isDefault(r))}),p}function dn(e,t,i,r){return t==="steps"&&i===0?`${e.stage.layers[0]?.rule.steps??""} as trained`:`${Number(i.toPrecision(3))}${r}`}async function Kr(){let e;try{e=await(await fetch("show.json",{cache:"no-cache"})).json()}catch{throw new M("show.json is not there or damaged: this page has nothing to show.")}if(!(Array.isArray(e.rules)&&e.rules.length>0&&e.rules.every(({name:i,model:r})=>jr(r)&&typeof i=="string")&&jr(e.smoke)))throw new M("show.json is damaged: this page has nothing to show.");return e}function jr(e){return typeof e=="string"&&/^[\w.-]+(\/[\w.-]+)*$/.test(e)&&!e.includes("..")}async function et(e){let t=await fetch(e,{cache:"no-cache"});if(!t.ok)throw new M(`${e}: the server says ${t.status}`);return t.arrayBuffer()}var fn=2e3,qr=.8,Yr=300,Pi=64;function Xr(e){let t=S("section",{id:"curves","aria-label":"Training"});document.body.append(t);let i="",r=async()=>{try{let s=JSON.parse(new TextDecoder().decode(await et("run.json")));mn(t,s),s.model!==i&&(i=s.model,await e.learned(await et(e.show.rules[0].model)))}catch{}setTimeout(()=>{r()},fn)};r()}function mn(e,{iteration:t,iterations:i,curves:r}){let s=i>0?` of ${i}`:"",n=Object.entries(r).filter(([,a])=>a.length>1).map(([a,l])=>{let c=l[l.length-1][1],h=S("figcaption",{},a,S("output",{},String(Number(c.toPrecision(3)))));return S("figure",{},h,pn(l))});e.replaceChildren(S("h2",{},`Iteration ${t}${s}`),...n)}function pn(e){let t=e.filter(([,f])=>Number.isFinite(f)),i=t.every(([,f])=>f>0),r=t.map(([,f])=>i?Math.log(f):f),s=Math.min(...r),n=Math.max(...r)-s||1,a=t[0]?.[0]??0,l=(t[t.length-1]?.[0]??1)-a||1,c=f=>f.map((p,b)=>{let x=Yr*(t[b][0]-a)/l;return`${b===0?"M":"L"}${x.toFixed(1)} ${(Pi-Pi*(p-s)/n).toFixed(1)}`}).join(""),h=r[0]??0,d=r.map(f=>h=qr*h+(1-qr)*f),m="http://www.w3.org/2000/svg",u=document.createElementNS(m,"svg");u.setAttribute("viewBox",`-2 -2 ${Yr+4} ${Pi+4}`);for(let[f,p]of[["raw",r],["mean",d]]){let b=document.createElementNS(m,"path");b.setAttribute("d",c(p)),b.setAttribute("class",f),u.append(b)}return u}var gn=500;function Qr(e){let t=S("nav",{id:"styles","aria-label":"Styles"}),i=new Map,r=async(c,h)=>{try{let d=h&&e.names[1]===c;await e.use(d?"":c,h?1:0)}catch(d){I(B(d))}},s=0,n=!1,a=()=>{for(let c of e.show.rules){if(i.has(c.name))continue;let h=S("button",{type:"button",title:`${c.title||c.name}. Right click, or hold: mix it with the one that paints`,onclick:d=>{n||r(c.name,d.shiftKey),n=!1},onpointerdown:d=>{n=!1,d.pointerType==="touch"&&(s=window.setTimeout(()=>{n=!0,r(c.name,!0)},gn))},onpointerup:()=>clearTimeout(s),onpointercancel:()=>clearTimeout(s),oncontextmenu:d=>{d.preventDefault(),n||r(c.name,!0),clearTimeout(s)}});c.thumbnail&&h.append(S("img",{src:c.thumbnail,alt:"",draggable:"false"})),h.append(S("span",{},c.name.replaceAll("_"," "))),i.set(c.name,h),c.model===""?t.prepend(h):t.append(h)}},l=()=>{a();for(let[c,h]of i)h.classList.toggle("first",e.names[0]===c),h.classList.toggle("second",e.names[1]===c),h.setAttribute("aria-pressed",String(e.names.includes(c)))};return e.addEventListener("rules",l),l(),t}var bn=3,wn=64*2**20,tt={channels:64,hidden:1024,units:256,dilation:64,steps:4096},Jr={position:3,density:1,velocity:3},yn=["first","second","third","output"];function _t(e,t){try{return vn(e,t)}catch(i){throw i instanceof M?i:new M(`${t}: damaged model (${i.message})`)}}function vn(e,t){let i=(P,U)=>C(P,`${t}: ${U}`);i(e.byteLength>=8,"not a model of vnca"),i(e.byteLength<=wn,"larger than any model of vnca");let r=Number(new DataView(e).getBigUint64(0,!0));i(r<=e.byteLength-8,"not a model of vnca");let s=Zr(new TextDecoder().decode(new Uint8Array(e,8,r)),t),n=s?.__metadata__?.vnca;i(typeof n=="string","not a model of vnca");let a=Zr(n,t);i(Number.isInteger(a.format_version)&&a.format_version>=1,"damaged model"),i(a.format_version<=bn,`its format, ${a.format_version}, is newer than this page`);let l=a.rule,c=P=>kn(e,8+r,s[P],`${t}: ${P}`),h=(P,U,L,G)=>{let O=typeof P=="number"&&P>=U&&P<=L;return i(O,`damaged model (${G} is not a number from ${U} to ${L})`),P},d=h(l.channels,4,tt.channels,"channels"),m=h(l.hidden,1,tt.hidden,"hidden"),u=a.conditioning??Object.entries(Jr).map(([P,U])=>[P,U]);i(Array.isArray(u),"damaged model");let f={},p=0;for(let[P,U]of u){let L=typeof P=="string"&&Jr[P]===U;i(L,`the rule is conditioned on ${String(P)}, which this page does not have`),l[`${P}_prior`]!==!1&&(f[P]=p),p+=U}let b=it(c("hidden"),m,5*d+p,`${t}: hidden`),x=it(c("bias"),m,1,`${t}: bias`),_=it(c("output"),d,m,`${t}: output`),{density:A,velocity:z,gamma:E}=a.scales;for(let P of[A,z,E])h(P,1e-30,1e30,"scale");return{name:t,title:String(a.training?.title??a.training?.style??""),channels:d,hidden:b,bias:x,output:_,decoder:xn(s,c,d,t),probability:h(l.update_probability,1e-9,1,"update_probability"),steps:h(l.steps_per_frame,1,tt.steps,"steps_per_frame"),dilation:h(l.dilation??l.reach??1,0,tt.dilation,"dilation"),wholeBox:l.domain==="box",sobel:h(l.sobel_divisor,1e-9,1e9,"sobel_divisor"),laplacian:h(l.laplacian_divisor,1e-9,1e9,"laplacian_divisor"),columns:f,width:p,density:A,speed:z,gamma:E,place:Sn(a.place,t)}}function Zr(e,t){try{return JSON.parse(e)}catch{throw new M(`${t}: not a model of vnca`)}}function kn(e,t,i,r){C(i!==void 0,`${r} is missing`),C(i.dtype==="F32",`${r}: expected F32, got ${String(i.dtype)}`);let[s,n=1]=i.shape,[a,l]=i.data_offsets,c=l-a===4*s*n&&a>=0&&t+l<=e.byteLength;C(c&&i.shape.length<=2,`${r}: its place in the file cannot be`);let h=new Float32Array(e.slice(t+a,t+l));return C(h.every(Number.isFinite),`${r}: not all finite`),{values:h,rows:s,columns:n}}function it(e,t,i,r){let s=e.rows===t&&e.columns===i;return C(s,`${r}: expected ${t} × ${i}, got ${e.rows} × ${e.columns}`),e}function xn(e,t,i,r){if(e["decoder.first"]===void 0)return[];let n=t("decoder.first").rows;return C(n>=1&&n<=tt.units,`${r}: a decoder of ${n} units`),yn.map((a,l)=>{let c=a==="output"?4:n,h=`${r}: decoder.${a}`;return{weights:it(t(`decoder.${a}`),c,l===0?i:n,h),bias:it(t(`decoder.${a}_bias`),c,1,`${h}_bias`)}})}function Sn(e,t){if(e==null)return null;let i=e.lattice_to_world,[r,s]=e.box,n=[...i.flat(),...r,...s],a=n.length===22&&n.every(l=>Number.isFinite(l)&&Math.abs(l)<1e30);return C(a&&r.every((l,c)=>l<s[c]),`${t}: its place cannot be`),{toWorld:i,lower:r,upper:s}}var En="vncasmk1",Tn=65536,Pn=2**24,Mn=1e5,_n=2**20,An=64*2**20,At=class e{constructor(t,i,r,s,n,a,l,c,h,d){this.url=t;this.name=i;this.fps=r;this.lower=s;this.upper=n;this.toWorld=a;this.density=l;this.speed=c;this.stored=h;this.begin=d}url;name;fps;lower;upper;toWorld;density;speed;stored;begin;frames=new Map;whole=null;get length(){return this.stored.length}number(t){return this.stored[t].number}static async open(t){let i=t.split("/").pop()??t,{bytes:r,isWhole:s}=await Mi(t,0,Tn);C(r.length>=12,`${i}: not a sequence of vnca`);let n=String.fromCharCode(...r.subarray(0,8));C(n===En,`${i}: not a sequence of vnca`);let a=new DataView(r.buffer,r.byteOffset).getUint32(8,!0);C(a<=Pn,`${i}: its header is damaged`),r.length<12+a&&!s&&({bytes:r,isWhole:s}=await Mi(t,0,12+a)),C(r.length>=12+a,`${i}: it ends within its header`);let l;try{let c=new TextDecoder().decode(r.subarray(12,12+a));l=e.described(t,i,JSON.parse(c),12+a)}catch(c){throw c instanceof M?c:new M(`${i}: its header is damaged (${B(c)})`)}return s&&(l.whole=r),l}static described(t,i,r,s){let n=(b,x)=>C(b,`${i}: its header is damaged (${x})`),[a,l]=r.box,c=[...a,...l].every(Number.isInteger)&&a.length===3;n(c&&a.every((b,x)=>b<l[x]),"box");let{density:h,speed:d,fps:m}=r;n(h>0&&h<1e30&&d>=0&&d<1e30,"scales"),n(m>0&&m<=1e3,"fps");let u=r.lattice_to_world;n(u.flat().length===16&&u.flat().every(Number.isFinite),"lattice_to_world");let f=r.frames;n(Array.isArray(f)&&f.length>=1&&f.length<=Mn,"frames");for(let{number:b,offset:x,length:_,bricks:A}of f){let z=[x,_,A].every(E=>Number.isInteger(E)&&E>=0);n(z&&Number.isInteger(b)&&A<=_n,"frames")}let p=String(r.name??i).slice(0,100);return new e(t,p,m,a,l,u,h,d,f,s)}frame(t){let i=this.frames.get(t);return i===void 0&&(i=this.read(this.stored[t]),this.frames.set(t,i),i.catch(()=>this.frames.delete(t)),this.forget()),i}forget(){let t=0;for(let i of[...this.frames.keys()].reverse())t+=this.stored[i].bricks*2048,t>An&&this.frames.delete(i)}async read(t){let{number:i,offset:r,length:s,bricks:n}=t,a=`${this.name}, frame ${i}`,l;if(this.whole===null){let{bytes:p,isWhole:b}=await Mi(this.url,this.begin+r,s);b&&(this.whole=p),l=b?p.subarray(this.begin+r,this.begin+r+s):p}else l=this.whole.subarray(this.begin+r,this.begin+r+s);C(l.length===s,`${a}: the file ends before it`);let c=n*(6+512*(this.speed>0?4:1)),h=await Un(l,c,a),d=this.lower.map(p=>Math.floor(p/8)),m=this.upper.map(p=>Math.floor((p-1)/8)),u=new DataView(h.buffer),f=new Int32Array(3*n);for(let p=0;p<f.length;p++)f[p]=u.getUint16(2*p,!0)+d[p%3],C(f[p]<=m[p%3],`${a}: a brick lies outside the box`);return{number:i,count:n,bricks:f,planes:h.slice(6*n)}}};async function Mi(e,t,i){let r=`bytes=${t}-${t+Math.max(i,1)-1}`,s=await fetch(e,{headers:{Range:r}});if(s.status!==206&&s.status!==200)throw new M(`${e.split("/").pop()}: the server says ${s.status}`);return{bytes:new Uint8Array(await s.arrayBuffer()),isWhole:s.status===200}}async function Un(e,t,i){let r=new Uint8Array(t),n=new Blob([e]).stream().pipeThrough(new DecompressionStream("deflate")).getReader(),a=0;try{for(;;){let{done:l,value:c}=await n.read();if(l)break;C(a+c.length<=t,`${i}: more than it says`),r.set(c,a),a+=c.length}}catch(l){throw n.cancel().catch(()=>{}),l instanceof M?l:new M(`${i}: damaged`)}return C(a===t,`${i}: less than it says`),r}var Ln=15,Cn=9,es=.3,zn=250,Bn=1.22,In=.07,Nn=["guide","guideAzimuth","guideElevation"],Ut=class e extends EventTarget{constructor(i,r,s){super();this.canvas=i;this.show=r;this.smoke=s}canvas;show;smoke;gpu;stage;isPlaying=!1;isAlive=!0;speed=1;tool="orbit";names=["",""];fineness=1;took=0;context;isDirty=!0;isSettled=!1;lastChange=0;due=0;isBusy=!1;isClosed=!1;rules=new Map;static async open(i,r){let s=new e(i,r,await At.open(r.smoke));return await s.start(),new ResizeObserver(()=>s.resized()).observe(i),requestAnimationFrame(s.tick),s}async start(){this.gpu=await at.open();let i=navigator.gpu.getPreferredCanvasFormat(),r=this.canvas.getContext("webgpu");if(r===null)throw new M("This browser gives WebGPU no canvas.");this.context=r,r.configure({device:this.gpu.device,format:i,alphaMode:"opaque"}),this.gpu.device.addEventListener("uncapturederror",s=>{I(`The GPU complains: ${B(s.error.message)}`)}),this.stage=await ut.create(this.gpu,this.smoke,i),this.reframe(),this.gpu.lost.then(s=>this.recover(s))}async recover(i){if(this.isClosed)return;let{settings:r,camera:s,at:n}=this.stage;I("The GPU was lost; the page begins again.");try{await this.start(),Object.assign(this.stage.settings,r),this.stage.camera=s,await this.use(this.names[0],0),this.names[1]&&await this.use(this.names[1],1),await this.goTo(Math.max(n,0)),this.dispatchEvent(new Event("recovered"))}catch(a){nt("The GPU is gone",`${B(a)} ${i.message}`)}}close(){this.isClosed=!0,this.gpu.device.destroy()}get aspect(){return(this.canvas.clientWidth||1)/(this.canvas.clientHeight||1)}resized(){this.changed()}changed(){this.isDirty=!0,this.isSettled=!1,this.lastChange=performance.now(),this.dispatchEvent(new Event("change"))}async rule(i){let r=this.rules.get(i);if(r===void 0){let s=this.show.rules.find(n=>n.name===i);if(s===void 0)throw new M(`There is no rule '${i}' here.`);r=_t(await et(s.model),i),this.rules.set(i,r)}return r}async use(i,r){let s=i===""?null:await this.rule(i);await this.exclusively(()=>this.stage.use(s,r)),this.names[r]=i,r===1&&i!==""&&this.stage.settings.mix===0&&this.set("mix",.5),this.changed(),this.dispatchEvent(new Event("rules"))}async add(i){let r=_t(await i.arrayBuffer(),i.name);this.rules.set(i.name,r),this.show.rules.unshift({name:i.name,title:r.title,model:""}),await this.use(i.name,0)}async learned(i){let r=this.names[0],s=_t(i,r);this.rules.set(r,s);let[n]=this.stage.layers;n?.learn(s)||await this.use(r,0),this.changed()}set(i,r){this.stage.settings[i]=r,Nn.includes(i)&&this.stage.conditionAgain(),i==="half"&&this.names.forEach((s,n)=>{this.use(s,n)}),this.stage.lookAgain(),this.changed()}get defaults(){return pe}isDefault(i){return this.stage.settings[i]===(this.show.settings[i]??pe[i])}async exclusively(i){for(;this.isBusy;)await new Promise(r=>setTimeout(r,5));this.isBusy=!0;try{await i()}finally{this.isBusy=!1}}async goTo(i){let r=Math.min(Math.max(i,0),this.smoke.length-1);await this.exclusively(()=>this.stage.show(r)),this.changed()}async restart(){await this.exclusively(()=>this.stage.restart()),this.changed()}async play(){this.stage.at===this.smoke.length-1&&await this.restart(),this.isPlaying=!0,this.due=performance.now(),this.changed()}pause(){this.isPlaying=!1,this.changed()}look(i){i(this.stage.camera),this.changed()}reframe(){let i=this.stage.framed(this.aspect);i.distance*=Bn,Bt(i,0,In),this.stage.camera=i,this.changed()}move(i,r){this.look(s=>Bt(s,i,r))}async touch(i,r){let{tool:s}=this;if(s!=="orbit"){if(s!=="erase"&&this.stage.layers.length<2){I("Choose a second style to brush it on.");return}await this.exclusively(()=>this.stage.touch(s,[i-.5,.5-r],this.aspect)),this.changed()}}tick=async i=>{if(!this.isClosed&&(requestAnimationFrame(r=>{this.tick(r)}),!(this.isBusy||document.hidden||this.stage.layers.length===0))){this.isBusy=!0;try{await this.frame(i)}catch(r){this.isPlaying=!1,I(B(r))}finally{this.isBusy=!1}}};async frame(i){let r=performance.now();this.isPlaying&&i>=this.due?await this.advance(i):this.isAlive&&!this.isPlaying&&!this.isSettled&&this.stage.at>=0&&(this.stage.step(1),this.isDirty=!0);let s=i-this.lastChange>zn&&!this.isPlaying;!this.isDirty&&(this.isSettled||!s)||(this.isDirty=!1,this.draw(s?1:this.fineness),this.isSettled=s&&!this.isAlive,await this.gpu.device.queue.onSubmittedWorkDone(),s||this.adapt(performance.now()-r))}async advance(i){let r=this.stage.at+1;if(r>=this.smoke.length){this.isPlaying=!1,this.dispatchEvent(new Event("ended")),this.changed();return}let s=i-this.due,n=1e3/(this.smoke.fps*this.speed);this.due=s>n?i+n:this.due+n,await this.stage.show(r),this.isDirty=!0,this.dispatchEvent(new Event("frame"))}draw(i){let r=window.devicePixelRatio||1,s=this.gpu.device.limits.maxTextureDimension2D,n=Math.min(Math.max(Math.round(this.canvas.clientWidth*r),1),s),a=Math.min(Math.max(Math.round(this.canvas.clientHeight*r),1),s);(this.canvas.width!==n||this.canvas.height!==a)&&([this.canvas.width,this.canvas.height]=[n,a]);let l=this.stage.take(Math.max(Math.round(n*i),16),Math.max(Math.round(a*i),16));this.stage.present(l,this.context.getCurrentTexture().createView(),n,a)}adapt(i){this.took=this.took===0?i:.8*this.took+.2*i,this.took>Ln?this.fineness>es?this.fineness=Math.max(this.fineness*.92,es):this.stage.samples=1:this.took<Cn&&(this.stage.samples===1?this.stage.samples=0:this.fineness=Math.min(this.fineness*1.04,1))}};var Rn=document.getElementById("canvas");async function Wn(){let e=await Kr();document.title=`${e.title} · vnca`;let t=await Ut.open(Rn,e);Object.assign(t.stage.settings,Vn(e.settings,t)),Object.assign(globalThis,{viewer:t}),await Ot(t,location.hash),window.addEventListener("hashchange",()=>{Ot(t,location.hash)}),Gn(t),document.body.classList.add("ready"),e.run?Xr(t):location.hash||await t.play()}function Vn(e,t){return Object.fromEntries(Object.entries(e).filter(([i])=>i in t.stage.settings))}function Gn(e){let t=S("span",{id:"painted"}),i=()=>{let[r,s]=e.names.map(n=>n.replaceAll("_"," "));t.textContent=s?`${r} and ${s}`:r};e.addEventListener("rules",i),i(),window.innerWidth<720&&document.body.classList.add("bare"),document.body.append(S("header",{},S("h1",{},e.smoke.name),t),Fr(e),Hr(e),S("footer",{},Qr(e),Or(e))),Ni(e),Dr(e),document.addEventListener("dragover",r=>r.preventDefault()),document.addEventListener("drop",r=>{r.preventDefault();let s=r.dataTransfer?.files[0];s&&e.add(s).catch(n=>I(B(n)))})}Wn().catch(e=>{let t=B(e),i=/WebGPU/.test(t);nt(i?"No WebGPU here":"This cannot be shown",i?`${t} ${Wi}`:t)});
