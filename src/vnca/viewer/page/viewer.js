/* vnca, Apache-2.0; sources b1300899e99ece46823388d6f4827a2f34aa6206da4fe9c2a111e1f175da0e0e */
function x(e,t={},...r){let i=document.createElement(e);for(let[s,n]of Object.entries(t))typeof n=="function"?i.addEventListener(s.slice(2),n):typeof n=="boolean"?i.toggleAttribute(s,n):i.setAttribute(s,String(n));return i.append(...r),i}function ts(e){let t="http://www.w3.org/2000/svg",r=document.createElementNS(t,"svg");r.setAttribute("viewBox","0 0 24 24"),r.setAttribute("aria-hidden","true");let i=document.createElementNS(t,"path");return i.setAttribute("d",e),r.append(i),r}function F(e,t,r){let i=x("button",{type:"button",title:e,"aria-label":e,onclick:r});return i.append(ts(t)),i}function Mr(e,t){let r=URL.createObjectURL(e);x("a",{href:r,download:t}).click(),setTimeout(()=>URL.revokeObjectURL(r),6e4)}function Ar(e,t){return e.map(r=>[0,1,2,3].map(i=>r.reduce((s,n,a)=>s+n*t[a][i],0)))}function Lt(e,t){return[0,1,2].map(r=>it(e[r],t)+e[r][3])}function Ur(e,t){return[0,1,2].map(r=>it(e[r],t))}function it(e,t){return e[0]*t[0]+e[1]*t[1]+e[2]*t[2]}function fe(e){let[t,r,i]=e.map(h=>h.slice(0,3)),s=(h,d)=>[h[1]*d[2]-h[2]*d[1],h[2]*d[0]-h[0]*d[2],h[0]*d[1]-h[1]*d[0]],n=[s(r,i),s(i,t),s(t,r)],a=it(t,n[0]),l=[0,1,2].map(h=>n.map(d=>d[h]/a)),c=[e[0][3],e[1][3],e[2][3]];return[...l.map(h=>[...h,-it(h,c)]),[0,0,0,1]]}function N(e,t,r=1){return e.map((i,s)=>i+r*t[s])}function I(e,t){return e.map(r=>r*t)}function Lr(e,t){return e.reduce((r,i,s)=>r+i*t[s],0)}var Ct=Math.PI/180,rs=.04;function O(e,t){let[r,i]=[e*Ct,t*Ct],s=[Math.cos(r),Math.sin(r),0],n=[-Math.sin(r),Math.cos(r),0],a=[0,0,1],l=N(I(n,Math.sin(i)),a,Math.cos(i)),c=N(I(n,Math.cos(i)),a,-Math.sin(i));return[s,l,c]}function se(e){return Math.tan(e*Ct/2)}function st(e){let[,,t]=O(e.azimuth,e.elevation);return N(e.target,t,-e.distance)}function zr(e,t,r,i,s,n){let a=O(r,i),l=I(N(e,t),.5),c=Array.from({length:8},(P,A)=>N([0,1,2].map(B=>(A>>B&1?t:e)[B]),l,-1)),[h,d,m]=a.map(P=>c.map(A=>Lr(A,P))),u=(1-2*rs)*se(n),[f,p]=Cr(h,m,u*s),[b,S]=Cr(d,m,u);return{target:N(N(l,a[0],f),a[1],b),azimuth:r,elevation:i,distance:Math.max(p,S),fieldOfView:n}}function Cr(e,t,r){let i=Math.max(...e.map((n,a)=>n-r*t[a])),s=Math.max(...e.map((n,a)=>-n-r*t[a]));return[(i-s)/2,(i+s)/(2*r)]}var Br=.35,Nr=89,is=12;function zt(e,t,r){e.azimuth=((e.azimuth+t)%360+360)%360,e.elevation=Math.min(Math.max(e.elevation+r,-Nr),Nr)}function Bt(e,t,r){let[i,s]=O(e.azimuth,e.elevation),n=2*e.distance*se(e.fieldOfView);e.target=N(N(e.target,i,-t*n),s,-r*n)}function Ce(e,t,r,i){e.distance=Math.min(Math.max(e.distance*t,r),i)}function Ir(e){let{canvas:t}=e,r=new Map,i=e.stage.camera.distance,s=i/20,n=i*10,a=!1,l=async u=>{if(a)return;a=!0;let{left:f,top:p,width:b,height:S}=t.getBoundingClientRect();await e.touch((u.clientX-f)/b,(u.clientY-p)/S),a=!1},c=u=>{let{left:f,width:p}=t.getBoundingClientRect();return(u.clientX-f)/p},h=!1,d=u=>e.tool!=="orbit"&&r.size===1&&!u.shiftKey&&!(u.buttons&6);t.addEventListener("pointerdown",u=>{t.setPointerCapture(u.pointerId),r.set(u.pointerId,u);let{wipe:f}=e.stage.settings;h=f<1&&Math.abs(c(u)-f)*t.clientWidth<is,!h&&d(u)&&l(u)}),t.addEventListener("pointermove",u=>{let f=r.get(u.pointerId);if(f===void 0)return;let p=u.clientX-f.clientX,b=u.clientY-f.clientY,S=[...r.values()].find(P=>P.pointerId!==u.pointerId);if(r.set(u.pointerId,u),h)e.set("wipe",Math.min(Math.max(c(u),.02),.98));else if(d(u))l(u);else if(S!==void 0){let P=A=>Math.hypot(A.clientX-S.clientX,A.clientY-S.clientY)||1;e.look(A=>Ce(A,P(f)/P(u),s,n)),e.move(p/2/t.clientHeight,-b/2/t.clientHeight)}else u.shiftKey||u.buttons&6?e.move(p/t.clientHeight,-b/t.clientHeight):e.look(P=>zt(P,-Br*p,Br*b))});let m=u=>{r.delete(u.pointerId),h=!1};t.addEventListener("pointerup",m),t.addEventListener("pointercancel",m),t.addEventListener("contextmenu",u=>u.preventDefault()),t.addEventListener("wheel",u=>{u.preventDefault();let f=u.deltaMode===WheelEvent.DOM_DELTA_LINE?30:1;e.look(p=>Ce(p,Math.exp(f*u.deltaY/900),s,n))},{passive:!1}),t.addEventListener("dblclick",()=>e.reframe())}var _=class extends Error{};function C(e){let t=String(e instanceof Error?e.message:e).replace(/\s+/g," ").trim();return t.length>300?`${t.slice(0,300)}…`:t}function L(e,t){if(!e)throw new _(t)}var ss=6e3,Wr=0;function z(e){let t=document.getElementById("notice")??x("div",{id:"notice",role:"status"});t.textContent=C(e),t.classList.add("shown"),document.body.append(t),clearTimeout(Wr),Wr=window.setTimeout(()=>t.classList.remove("shown"),ss)}function nt(e,t){document.getElementById("stopped")?.remove(),document.body.classList.add("stopped"),document.body.append(x("main",{id:"stopped"},x("h1",{},e),x("p",{id:"reason"},C(t))))}var Rr="WebGPU is in current Chrome and Edge, in Safari 26 and in Firefox. On Linux Chrome may have to be started with --enable-unsafe-webgpu --enable-features=Vulkan.";var Nt=`// What a finger does: to the smoke that it points at, erase the state or change the mix of rules.

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
`;var Vr=`// The picture on the screen: in front of the soft background of films, as sRGB.

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
`;var Y=`// The smoke of a frame as its file has it: bytes of bricks, made into numbers where they are read.

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

// A velocity turned towards a direction by a part; one that rests, as if it had half of \`unit\`.
fn guided(velocity: vec3f, guide: vec4f, unit: f32) -> vec3f {
  return mix(velocity, guide.xyz * max(length(velocity), 0.5 * unit), guide.w);
}
`;var D=`// Where cells lie: rows of the state by index coordinates, through a map of bricks of 8³ cells.
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
`;function W(e){return Math.ceil(e/4)}function Gr(e){let t=e;return t^=t>>>16,t=Math.imul(t,2146121005),t^=t>>>15,t=Math.imul(t,2221713035),t^=t>>>16,t>>>0}function $r(e,t){return Gr((e>>>0)+Gr(t>>>0)>>>0)}function Or(e){return Math.min(Math.max(Math.round(e*2**32),1),2**32-1)}function Dr(e,t){let r=new Float32Array(216),i=[1,2,1];for(let s=0;s<27;s++){let[n,a,l]=[Math.floor(s/9),Math.floor(s/3)%3,s%3],c=Math.abs(n-1)+Math.abs(a-1)+Math.abs(l-1);r.set([c===0?1:0,(n-1)*i[a]*i[l]/e,(a-1)*i[n]*i[l]/e,(l-1)*i[n]*i[a]/e,[-88,6,3,2][c]/t],8*s)}return r}function It(e,t,r){let{channels:i,hidden:s,bias:n,output:a}=e,l=4*W(i),c=5*l+t+l,h=new Float32Array(s.rows*c);for(let d=0;d<s.rows;d++){let m=s.values.subarray(d*s.columns,(d+1)*s.columns),u=d*c;for(let f=0;f<5;f++){let p=m.subarray(f*i,(f+1)*i);h.set(p,u+f*l)}h.set(m.subarray(5*i),u+5*l),h[u+5*l+t-1]=n.values[d];for(let f=0;f<i;f++){let p=u+5*l+t+f;h[p]=a.values[f*a.columns+d]}}return r?cs(h):h}function Wt(e){if(e.decoder.length===0)return new Float32Array(4);let t=4*W(e.decoder[0].weights.rows),r=e.decoder.flatMap(({weights:n,bias:a},l)=>{let c=l<3?t:4;return[Fr(n,c,4*W(n.columns)),Fr(a,c,1)]}),i=new Float32Array(r.reduce((n,a)=>n+a.length,0)),s=0;for(let n of r)i.set(n,s),s+=n.length;return i}function Fr(e,t,r){let i=new Float32Array(t*r);for(let s=0;s<e.rows;s++){let n=e.values.subarray(s*e.columns,(s+1)*e.columns);i.set(n,s*r)}return i}function cs(e){let t=new Uint32Array(e.slice().buffer);return Uint16Array.from(t,r=>{let i=r>>>16&32768,s=r&2147483647;if(s>=1199570944)return i|31744;if(s<855638016)return i;if(s<947912704){let l=126-(s>>>23),c=s&8388607|8388608,h=c>>>l,d=c&(1<<l)-1,m=1<<l-1;return i|h+(d>m||d===m&&h&1?1:0)}let n=s-939524096>>>13,a=s&8191;return i|n+(a>4096||a===4096&&n&1?1:0)})}var hs=["maxBufferSize","maxStorageBufferBindingSize","maxTextureDimension3D","maxTextureDimension2D"],us=65535,at=class e{constructor(t,r,i){this.device=t;this.name=r;this.hasHalf=i;this.lost=t.lost}device;name;hasHalf;lost;modules=new Map;pipelines=new Map;static async open(){if(!("gpu"in navigator))throw new _("This browser has no WebGPU.");let t=await navigator.gpu.requestAdapter({powerPreference:"high-performance"});if(t===null)throw new _("This browser has WebGPU, but finds no GPU that it may use.");let r=t.features.has("shader-f16"),i={};for(let c of hs)i[c]=t.limits[c];let s=await t.requestDevice({requiredFeatures:r?["shader-f16"]:[],requiredLimits:i}),{vendor:n,architecture:a,description:l}=t.info;return new e(s,l||`${n} ${a}`.trim()||"a GPU",r)}buffer(t,r,i=0){let s=typeof t=="number"?t:t.byteLength,n=Math.min(this.device.limits.maxStorageBufferBindingSize,this.device.limits.maxBufferSize);if(s>n)throw new _(`${r} takes ${ot(s)}, and this GPU binds at most ${ot(n)}: choose a smaller sequence or less detail.`);let a=this.device.createBuffer({size:Math.max(16,Math.ceil(s/4)*4),usage:GPUBufferUsage.STORAGE|GPUBufferUsage.COPY_DST|GPUBufferUsage.COPY_SRC|i});return typeof t!="number"&&this.write(a,t),a}uniform(t){let r=GPUBufferUsage.UNIFORM|GPUBufferUsage.COPY_DST;return this.device.createBuffer({size:t,usage:r})}write(t,r,i=0){this.device.queue.writeBuffer(t,i,r.buffer,r.byteOffset,r.byteLength)}module(t){let r=this.modules.get(t);return r===void 0&&(r=this.device.createShaderModule({code:t}),this.modules.set(t,r)),r}compute(t,r){let i=`${r}
${t}`,s=this.pipelines.get(i);if(s===void 0){let n={module:this.module(t),entryPoint:r};s=this.device.createComputePipelineAsync({layout:"auto",compute:n}),this.pipelines.set(i,s)}return s}render(t,r,i){let s=this.module(t);return this.device.createRenderPipelineAsync({layout:"auto",vertex:{module:s,entryPoint:"corner"},fragment:{module:s,entryPoint:r,targets:[{format:i}]}})}bound(t,r,i){let s=Object.entries(i).map(([n,a])=>({binding:Number(n),resource:a instanceof GPUBuffer?{buffer:a}:a}));return this.device.createBindGroup({layout:t.getBindGroupLayout(r),entries:s})}submit(t){let r=this.device.createCommandEncoder();t(r),this.device.queue.submit([r.finish()])}async read(t,r=t.size){let i=GPUBufferUsage.COPY_DST|GPUBufferUsage.MAP_READ,s=this.device.createBuffer({size:r,usage:i});this.submit(a=>a.copyBufferToBuffer(t,0,s,0,r)),await s.mapAsync(GPUMapMode.READ);let n=s.getMappedRange().slice(0);return s.destroy(),n}async pixels(t,r){let{width:i,height:s}=t,n=i*r,a=Math.ceil(n/256)*256,l=GPUBufferUsage.COPY_DST|GPUBufferUsage.MAP_READ,c=this.device.createBuffer({size:a*s,usage:l});this.submit(m=>m.copyTextureToBuffer({texture:t},{buffer:c,bytesPerRow:a},{width:i,height:s})),await c.mapAsync(GPUMapMode.READ);let h=new Uint8Array(c.getMappedRange()),d=new Uint8Array(n*s);for(let m=0;m<s;m++)d.set(h.subarray(m*a,m*a+n),m*n);return c.destroy(),d.buffer}};function R(e,t,r,i){let s=e.beginComputePass();if(s.setPipeline(t),r.forEach((n,a)=>s.setBindGroup(a,n)),typeof i=="number"){let n=Math.ceil(i/us)||1;s.dispatchWorkgroups(Math.ceil(i/n),n)}else s.dispatchWorkgroups(...i);s.end()}function ot(e){return`${Number((e/2**20).toPrecision(3))} MiB`}var Hr=`// The state on the cells of another frame, carried there by its velocity: \`painting/transport.py\`.
//
// \`sites\` are those that it comes from. Places are counted from the cell, which keeps their digits.

struct Wanted {
  map: u32,       // Of the cells that want a state: how many places their map has,
  bricks: u32,    // how many bricks hold them,
  cells: u32,     // and how many there are.
  frames: f32,    // For how long the velocity carries it; below zero back, 0 not at all.
  guide: vec4f,   // As the rule is told.
  speed: f32,     // That counts as 1.
}

@group(1) @binding(0) var<uniform> wanted: Wanted;
@group(1) @binding(1) var<storage, read> wanted_places: array<u32>;
@group(1) @binding(2) var<storage, read> before: array<vec4f>;
@group(1) @binding(3) var<storage, read_write> after: array<vec4f>;

// What must be active upstream of a cell for it to have its state from there.
const LEAST_SHARE = 0.25;
// What must be known of the velocity.
const LEAST_KNOWN = 1e-6;
const FARTHEST = 1048576.0;

fn wanted_cell(row: u32) -> vec3i {
  let at = wanted_places[wanted.map + 515u * wanted.bricks + row];
  let brick = wanted.map + 3u * (at >> 9);
  let corner = vec3u(wanted_places[brick], wanted_places[brick + 1u], wanted_places[brick + 2u]);
  return vec3i(corner) * 8 + vec3i(vec3u((at >> 6) & 7u, (at >> 3) & 7u, at & 7u));
}

fn side_of(corner: u32) -> vec3i {
  return vec3i(vec3u(corner >> 2, (corner >> 1) & 1u, corner & 1u));
}

fn share_of(side: vec3i, upper: vec3f) -> f32 {
  let parts = select(1.0 - upper, upper, side == vec3i(1));
  return parts.x * parts.y * parts.z;
}

// By how much what is at a cell has come to it: a midpoint step back.
fn moved(cell: vec3i) -> vec3f {
  let here = wanted.frames * guided(velocity_at(cell), wanted.guide, wanted.speed);
  let last = smoke.upper - 1;
  let halfway = clamp(-0.5 * here, vec3f(smoke.lower - cell), vec3f(last - cell));
  let below = min(cell + vec3i(floor(halfway)), max(last - 1, smoke.lower));
  let upper = halfway - vec3f(below - cell);
  let beside = select(vec3i(0), vec3i(1), last > smoke.lower);
  var total = vec3f(0.0);
  var known = 0.0;
  for (var corner = 0u; corner < 8u; corner++) {
    let side = side_of(corner);
    let velocity = velocity_at(below + side * beside);
    if (any(velocity != vec3f(0.0))) {
      let share = share_of(side, upper);
      total += share * guided(velocity, wanted.guide, wanted.speed);
      known += share;
    }
  }
  if (known > LEAST_KNOWN) {
    return wanted.frames * (total / known);
  }
  return here;
}

@compute @workgroup_size(64)
fn carry(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let row = thread.y * groups.x * 64u + thread.x;
  if (row >= wanted.cells) {
    return;
  }
  let cell = wanted_cell(row);
  let upstream = clamp(-moved(cell), vec3f(-FARTHEST), vec3f(FARTHEST));
  let first = floor(upstream);
  var rows: array<u32, 8>;
  var shares: array<f32, 8>;
  var total = 0.0;
  for (var corner = 0u; corner < 8u; corner++) {
    let side = side_of(corner);
    rows[corner] = row_of(bordered(cell + vec3i(first) + side));
    shares[corner] = select(0.0, share_of(side, upstream - first), rows[corner] < sites.cells);
    total += shares[corner];
  }
  if (total < LEAST_SHARE) {
    rows[0] = row_of(cell);
    shares = array<f32, 8>(select(0.0, 1.0, rows[0] < sites.cells), 0, 0, 0, 0, 0, 0, 0);
    total = 1.0;
  }
  for (var p = 0u; p < PLANES; p++) {
    var value = vec4f(0.0);
    for (var corner = 0u; corner < 8u; corner++) {
      if (shares[corner] > 0.0) {
        value += (shares[corner] / total) * before[rows[corner] * PLANES + p];
      }
    }
    after[row * PLANES + p] = value;
  }
}
`;var jr=`// What the cells of a rule are conditioned on: position, density, velocity, as \`rule/conditioning.py\`.

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
    let turned = guided(own, given.guide, 1.0);
    let limited = turned * (SPEED_LIMIT / max(length(turned), SPEED_LIMIT));
    for (var axis = 0u; axis < 3u; axis++) {
      told[first + u32(given.columns.z) + axis] = limited[axis];
    }
  }
}
`;var Kr=`// What is seen of a state: the mean over each part of a cell, as \`painting/__init__.py\` paints it.

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
`;var qr=`// What is seen of a state between cells: its first four channels and what three sine layers add.
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
`;var Yr=`// One step: s' = s + m · W2 relu(W1 [perception ‖ priors ‖ 1]), the bias being W1's last column.
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
`;var Rt=class{constructor(t,r){this.lower=t;this.upper=r;this.size=[0,1,2].map(i=>r[i]-t[i]),this.values=new Uint8Array(this.size[0]*this.size[1]*this.size[2])}lower;upper;size;values;at(t,r,i){let[s,n,a]=this.lower;return((t-s)*this.size[1]+(r-n))*this.size[2]+(i-a)}holds(t,r,i){let{lower:s,upper:n}=this;return t>=s[0]&&t<n[0]&&r>=s[1]&&r<n[1]&&i>=s[2]&&i<n[2]}spread(t,r){let{size:i,values:s}=this,n=[i[1]*i[2],i[2],1],a=Uint8Array.from(s,l=>l>0?1:0);for(let l=0;l<3;l++){let c=n[l],h=i[l],d=a.slice();for(let m=0;m<d.length;m++){if(d[m]===0)continue;let u=Math.floor(m/c)%h,f=-Math.min(t,u),p=Math.min(t,h-1-u);for(let b=f;b<=p;b++)a[m+b*c]=1}}for(let l=0;l<s.length;l++)s[l]===0&&a[l]===1&&(s[l]=r)}};function Xr(e,t,r,i,s){let n=e.lower.map(c=>c-i),a=e.upper.map(c=>c+i),l=new Rt(n,a);return s?l.values.fill(1):(bs(l,e,t,255*Math.sqrt(.01*r/e.density)),l.spread(i,1),l.spread(3,2)),ws(l,e)}function bs(e,t,r,i){for(let s=0;s<r.count;s++){let[n,a,l]=[0,1,2].map(c=>8*r.bricks[3*s+c]);for(let c=0;c<512;c++){if(r.planes[512*s+c]<=i)continue;let[h,d,m]=[n+(c>>6),a+(c>>3&7),l+(c&7)];h>=t.lower[0]&&h<t.upper[0]&&d>=t.lower[1]&&d<t.upper[1]&&m>=t.lower[2]&&m<t.upper[2]&&(e.values[e.at(h,d,m)]=1)}}}function ws(e,t){let r=e.lower.map(p=>Math.floor(p/8)),i=e.upper.map((p,b)=>Math.floor((p-1)/8)+1-r[b]),s=new Uint32Array(i[0]*i[1]*i[2]).fill(4294967295),n=[],a=[],l=[],c=[],h=0;for(let p=0;p<i[0];p++)for(let b=0;b<i[1];b++)for(let S=0;S<i[2];S++,h++){let P=[8*(p+r[0]),8*(b+r[1]),8*(S+r[2])];ys(e,t,P,a.length,l,c)&&(s[h]=a.length,a.push(h),n.push(p+r[0],b+r[1],S+r[2]))}let d=a.length,m=s.length+3*d,u=new Uint32Array(m+512*d+l.length+c.length);u.set(s),u.set(Int32Array.from(n),s.length),u.fill(4294967295,m,m+512*d),[l,c].flat().forEach((p,b)=>{u[m+p]=b,u[m+512*d+b]=p});let f=new Int32Array(16);return f.set([...e.lower,l.length,...e.upper,0,...r,d,...i,0]),{cells:l.length,beside:c.length,uniform:f,places:u}}function ys(e,t,[r,i,s],n,a,l){let c=a.length+l.length;for(let h=0;h<512;h++){let[d,m,u]=[r+(h>>6),i+(h>>3&7),s+(h&7)];if(!e.holds(d,m,u))continue;let f=e.values[e.at(d,m,u)];f===1?a.push(512*n+h):f===2&&d>=t.lower[0]&&d<t.upper[0]&&m>=t.lower[1]&&m<t.upper[1]&&u>=t.lower[2]&&u<t.upper[2]&&l.push(512*n+h)}return a.length+l.length>c}var lt=256,Jr=64,ct=class e{constructor(t,r,i,s,n){this.gpu=t;this.rule=r;this.smoke=i;this.pipelines=s;this.isHalf=n;let a=4*W(r.width+1);this.uniform=t.uniform(64),this.steps=t.uniform(lt*Jr),this.filters=t.uniform(864),t.write(this.filters,Dr(r.sobel,r.laplacian)),this.weights=t.buffer(It(r,a,n),"the rule"),this.network=t.buffer(Wt(r),"the decoder"),this.given=t.uniform(112),this.wanted=t.uniform(48),this.now=Array.from({length:14},()=>t.uniform(32))}gpu;rule;smoke;pipelines;isHalf;sites=null;stepsDone=0;painted=null;uniform;places=null;state=null;spare=null;told=null;paintedFor=0;steps;filters;weights;network;given;wanted;now;static async create(t,r,i,s){let n=s&&t.hasHalf,a=`const PLANES = ${W(r.channels)}u;
`,l=r.decoder.length>0?W(r.decoder[0].weights.rows):0,c=W(r.width+1),h=n?`enable f16;
alias Factor = f16;
`:`alias Factor = f32;
`,d=`const TOLD = ${c}u;
const HIDDEN = ${r.hidden.rows}u;
`,m=`${a}const UNITS4 = ${l}u;
${D}${qr}${Kr}`,[u,f,p,b,S]=await Promise.all([t.compute(`${h}${a}${d}${D}${Yr}`,"step"),t.compute(`${D}${Y}${jr}`,"condition"),t.compute(`${a}${D}${Y}${Hr}`,"carry"),t.compute(m,"paint"),t.compute(m,"rim")]);return new e(t,r,i,{step:u,condition:f,carry:p,paint:b,rim:S},n)}learn(t){let r=i=>JSON.stringify([i.channels,i.hidden,i.columns,i.width,i.dilation,i.decoder.length].map(s=>typeof s=="object"&&"values"in s?[s.rows,s.columns]:s));return r(t)!==r(this.rule)?!1:(this.gpu.write(this.weights,It(t,4*W(t.width+1),this.isHalf)),this.gpu.write(this.network,Wt(t)),this.rule=t,!0)}enter(t,r,i){let{gpu:s,rule:n}=this,a=Xr(this.smoke,t.frame,n.density,n.dilation,n.wholeBox),l=s.buffer(a.places,"the list of cells"),c=(a.cells+1)*16*W(n.channels),h=s.buffer(c,"the state");if(this.sites!==null&&this.state!==null&&a.cells>0){this.writeWanted(a,r,i);let{carry:d}=this.pipelines,m=[s.bound(d,0,{0:this.uniform,1:this.places}),s.bound(d,1,{0:this.wanted,1:l,2:this.state,3:h}),s.bound(d,2,{0:t.uniform,1:t.bytes})];s.submit(u=>R(u,d,m,Math.ceil(a.cells/64)))}this.release(),s.write(this.uniform,a.uniform),this.sites=a,this.places=l,this.state=h,this.spare=s.buffer(c,"the state"),this.told=s.buffer(a.cells*16*W(n.width+1),"the conditioning"),this.condition(t,r)}writeWanted(t,r,i){let[,,,,,,,,,,,s,n,a,l]=t.uniform,c=new ArrayBuffer(48);new Uint32Array(c).set([n*a*l,s,t.cells]);let h=new Float32Array(c);h.set([i,...this.alongCells(r.direction),r.amount,this.rule.speed],3),this.gpu.write(this.wanted,h)}condition(t,r){let{gpu:i,rule:s,sites:n}=this;if(n===null||n.cells===0)return;let a=new ArrayBuffer(112),l=new Float32Array(a),c=this.placeMatrix();for(let p=0;p<16;p++)l[p]=c[p%4][p>>2];let{position:h=-1,density:d=-1,velocity:m=-1}=s.columns;new Int32Array(a).set([h,d,m,4*W(s.width+1)],16),l.set([s.density,s.speed],20),l.set([...this.alongCells(r.direction),r.amount],24),i.write(this.given,l);let{condition:u}=this.pipelines,f=[i.bound(u,0,{0:this.uniform,1:this.places}),i.bound(u,1,{0:this.given,1:this.told}),i.bound(u,2,{0:t.uniform,1:t.bytes})];i.submit(p=>R(p,u,f,Math.ceil(n.cells/64)))}alongCells(t){let r=fe(this.smoke.toWorld),i=[0,1,2].map(n=>t.reduce((a,l,c)=>a+r[n][c]*l,0)),s=Math.hypot(...i)||1;return i.map(n=>n/s)}placeMatrix(){let{place:t,dilation:r}=this.rule,i=[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]],s=this.smoke.lower.map(a=>a-r),n=this.smoke.upper.map(a=>a+r);if(t!==null){let a=Ar(fe(t.toWorld),this.smoke.toWorld);this.isNear(a,t.lower,t.upper)&&([i,s,n]=[a,t.lower,t.upper])}return i.map((a,l)=>{if(l===3)return a;let c=2/(n[l]-s[l]),h=a.map(d=>d*c);return h[3]+=(1-2*s[l])/(n[l]-s[l])-1,h})}isNear(t,r,i){let s=[1/0,1/0,1/0],n=[-1/0,-1/0,-1/0];for(let a=0;a<8;a++){let l=[0,1,2].map(c=>(a>>c&1?this.smoke.upper:this.smoke.lower)[c]-.5);for(let c=0;c<3;c++){let[h,d,m,u]=t[c],f=h*l[0]+d*l[1]+m*l[2]+u;s[c]=Math.min(s[c],f),n[c]=Math.max(n[c],f)}}return[0,1,2].every(a=>n[a]>r[a]-.5&&s[a]<i[a]-.5)}step(t,r){let{gpu:i,rule:s,sites:n}=this;for(let a=0;a<t;){let l=Math.min(Jr,t-a),c=new Uint32Array(lt/4*l);for(let h=0;h<l;h++){let d=$r(r,this.stepsDone+a+h),m=s.probability>=1?1:0;c.set([d,Or(s.probability),m,0],lt/4*h)}i.write(this.steps,c),n!==null&&n.cells>0&&this.submitSteps(l),a+=l}this.stepsDone+=t}submitSteps(t){let{gpu:r,sites:i}=this,{step:s}=this.pipelines;r.submit(n=>{for(let a=0;a<t;a++){let l=r.bound(s,0,{0:this.uniform,1:this.places,2:{buffer:this.steps,offset:lt*a,size:16},3:this.filters,4:this.weights,5:this.told,6:this.state,7:this.spare});R(n,s,[l],Math.ceil(i.cells/256)),[this.state,this.spare]=[this.spare,this.state]}})}get shown(){return this.sites===null?0:this.sites.cells+this.sites.beside}paint(t,r){let{gpu:i,rule:s,sites:n}=this;if(n===null)return;let a=(n.cells+n.beside)*t**3;if((this.painted===null||this.paintedFor!==a)&&(this.painted?.destroy(),this.painted=i.buffer(16*a,"the painting"),this.paintedFor=a),a===0)return;let{paint:l,rim:c}=this.pipelines,h=[n.cells,...Array(3*t+1).fill(n.beside)];h.forEach((u,f)=>{let p=new Int32Array([t,r,Math.max(f-1,0),u,s.dilation,0,0,0]);i.write(this.now[f],p)});let d={0:this.uniform,1:this.places},m=[i.bound(l,0,d),i.bound(l,1,{0:this.network}),i.bound(l,2,{0:this.now[0],1:this.state,2:this.painted})];i.submit(u=>{let f=p=>Math.ceil(p*t**3/64);n.cells>0&&R(u,l,m,f(n.cells));for(let p=1;p<h.length&&n.beside>0;p++){let b=[i.bound(c,0,d),i.bound(c,1,{}),i.bound(c,2,{0:this.now[p],2:this.painted})];R(u,c,b,f(n.beside))}})}reset(){this.release(),this.sites=null,this.stepsDone=0}release(){for(let t of[this.places,this.state,this.spare,this.told,this.painted])t?.destroy();this.places=this.state=this.spare=this.told=this.painted=null,this.paintedFor=0}destroy(){this.release();let t=[this.uniform,this.steps,this.filters,this.weights,this.network,this.given];for(let r of[...t,this.wanted,...this.now])r.destroy()}};var Vt=`// How much smoke lies between each place and the light, as \`rendering/light.py\` finds it: layer by
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
`;var Zr=`// Emission and absorption along the rays of a camera, as \`rendering/\` adds them up: samples lie at
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
`;var ei=`// What is drawn: density, and colour times density, at every cell of the box and one beside it.

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
`;var Ss=96,ri=[[.5,1],[.3,1/4],[.2,1/16]],Es=ri.reduce((e,[t,r])=>e+t/(1+r),0),Ts=2**27,Gt="rgba16float",ze=class e{constructor(t,r,i){this.gpu=t;this.smoke=r;this.pipelines=i;this.looks=[0,1].map(()=>t.uniform(32)),this.camera=t.uniform(128),this.sampler=t.device.createSampler({magFilter:"linear",minFilter:"linear"}),this.nothing=this.texture([1,1,1])}gpu;smoke;pipelines;parts=0;size=[];textures=[];buffers=null;drawn=null;reached=null;blocks=null;thickness=null;depth=null;looks;camera;sampler;nothing;static async create(t,r){let[i,s,n,a]=await Promise.all([t.compute(`${D}${Y}${ei}`,"volume"),t.compute(Vt,"gather"),t.compute(Vt,"sweep"),t.render(`${Y}${Zr}`,"march",Gt)]);return new e(t,r,{volume:i,gather:s,sweep:n,march:a})}refine(t){if(t===this.parts)return;this.release();let{lower:r,upper:i}=this.smoke;this.size=r.map((a,l)=>(i[l]-a)*t+2);let s=this.gpu.device.limits.maxTextureDimension3D,n=this.size.reduce((a,l)=>a*l,1);if(Math.max(...this.size)>s||n>Ts){let a=this.size.join(" × ");throw new _(`A volume of ${a} (${ot(8*n)}) is more than this page draws: choose a smaller sequence or less detail.`)}this.parts=t,this.textures=[0,1].map(()=>this.texture(this.size)),this.makeBlocks()}makeBlocks(){let{gpu:t,smoke:r,parts:i}=this,[s,n]=_s(r,i),a=Math.max(...s.map((u,f)=>n[f]-u))/Ss,l=Math.max(Math.round(a),1),c=r.lower.map(u=>Math.floor(u*i/l)-1),h=r.upper.map(u=>Math.floor((u*i-1)/l)+1),d=c.map((u,f)=>h[f]-u+1),m=d.reduce((u,f)=>u*f,1);this.reached=this.texture(d),this.thickness=t.buffer(4*m,"the light"),this.depth=t.buffer(4*m,"the light"),this.blocks={first:c,size:d,times:l,slots:t.uniform(256*Math.max(...d))}}texture(t){return this.gpu.device.createTexture({size:t,dimension:"3d",format:"rgba16float",usage:GPUTextureUsage.TEXTURE_BINDING|GPUTextureUsage.STORAGE_BINDING|GPUTextureUsage.COPY_SRC})}draw(t,r,i,s){this.buffers=t;let n=this.nothing;r.forEach((a,l)=>{let c=new ArrayBuffer(32),h=s.isPlain?1:0;new Int32Array(c).set([this.parts,h,l>0?1:0]);let{mixed:d,strength:m,densityStrength:u}=s,f=s.isPlain?0:u;new Float32Array(c).set([d,m,f,a.rule.density],3),this.gpu.write(this.looks[l],new Uint8Array(c)),n=this.drawLayer(t,a,l,i,n)}),this.drawn=n,s.light.strength>0&&this.shine(s)}drawLayer(t,r,i,s,n){let{gpu:a}=this,{volume:l}=this.pipelines,c=this.textures[i],h=[a.bound(l,0,{0:r.uniform,1:r.places}),a.bound(l,1,{0:this.looks[i],1:r.painted,2:s,3:n.createView(),4:c.createView()}),a.bound(l,2,{0:t.uniform,1:t.bytes})];return a.submit(d=>R(d,l,h,ti(this.size))),c}shine({light:t,gamma:r}){let{gpu:i,parts:s}=this,{gather:n,sweep:a}=this.pipelines,{first:l,size:c,times:h,slots:d}=this.blocks,[,,m]=O(t.azimuth,t.elevation),u=I(ht(this.smoke,I(m,-1)),1/h),f=u.map(Math.abs).reduce((M,$,T,U)=>$>U[M]?T:M,0),p=[0,1,2].filter(M=>M!==f),b=p.map(M=>u[M]/Math.abs(u[f])),S=.5/Math.abs(u[f])*r/s,P=this.smoke.lower.map(M=>M*s-1),A=new ArrayBuffer(256*c[f]);for(let M=0;M<c[f];M++){let $=new Int32Array(A,256*M,16),T=new Float32Array(A,256*M,16);$.set([...l,f,...c,h,...P,u[f]>0?1:0]),T.set([...b,S],12),$[15]=M}i.write(d,new Uint8Array(A));let B=M=>({buffer:d,offset:256*M,size:64});i.submit(M=>{let $={1:this.drawn.createView(),2:this.thickness};R(M,n,[i.bound(n,0,{0:B(0),...$})],ti(c));let[T,U]=p.map(G=>Math.ceil(c[G]/8));for(let G=0;G<c[f];G++){let de=i.bound(a,0,{0:B(G),2:this.thickness,3:this.depth,4:this.reached.createView()});R(M,a,[de],[T,U,1])}})}take(t,r,i,s,n,[a,l]=[0,1],c=!0){let{gpu:h,parts:d}=this,m=r.width/r.height,u=2*se(i.fieldOfView),[f,p,b]=O(i.azimuth,i.elevation),S=Le=>ht(this.smoke,Le),{light:P}=s,A=Math.max(1-P.strength,0),B=this.blocks,M=B.first.map((Le,es)=>(Le+.5)*B.times-.5-this.smoke.lower[es]*d+1),$=new Float32Array([...this.place(st(i)),d,...S(b),n,...S(I(f,u)),m,...S(I(p,u)),s.gamma/d*n,...this.size,0,...M,B.times,A,P.strength,P.ambient,P.strength>0?1:0,...ri.map(([Le])=>Le/Es),0]);h.write(this.camera,$);let{march:T}=this.pipelines,U=t.beginRenderPass({colorAttachments:[{view:r.createView(),loadOp:c?"clear":"load",storeOp:"store",clearValue:[0,0,0,0]}]});U.setPipeline(T);let G=h.bound(T,0,{0:this.camera,1:this.drawn.createView(),2:this.reached.createView(),3:this.sampler});U.setBindGroup(0,G),U.setBindGroup(1,h.bound(T,1,{})),U.setBindGroup(2,h.bound(T,2,{0:this.buffers.uniform,1:this.buffers.bytes}));let de=Math.round(a*r.width),rt=Math.round(l*r.width)-de;rt>0&&(U.setScissorRect(de,0,rt,r.height),U.draw(3)),U.end()}place(t){return Lt(fe(this.smoke.toWorld),t).map((i,s)=>(i+.5)*this.parts-.5-this.smoke.lower[s]*this.parts+1)}get texture3d(){return this.drawn}get cells(){return this.size}get refinement(){return this.parts}release(){for(let t of this.textures)t.destroy();for(let t of[this.reached,this.thickness,this.depth,this.blocks?.slots])t?.destroy()}destroy(){this.release();for(let t of[this.camera,this.nothing,...this.looks])t.destroy()}};function ht(e,t){return I(Ur(fe(e.toWorld),t),ii(e))}function ii(e){return Math.hypot(...[0,1,2].map(t=>e.toWorld[t][0]))}function _s(e,t){let r=ii(e)/t,[i,s]=Ft(e,e.toWorld);return[I(i,1/r),I(s,1/r)]}function Ft(e,t){let r=Array.from({length:8},(s,n)=>{let a=[0,1,2].map(l=>(n>>l&1?e.upper:e.lower)[l]-.5);return Lt(t,a)}),i=s=>[0,1,2].map(n=>s(...r.map(a=>a[n])));return[i(Math.min),i(Math.max)]}function ti(e){return e.map(t=>Math.ceil(t/4))}var me={seed:0,steps:0,warmup:64,patternSpeed:-1,strength:1,densityStrength:1,density:1,exposure:0,light:1.2,lightAzimuth:-55,lightElevation:40,ambient:.15,guide:0,guideAzimuth:0,guideElevation:90,mix:0,wipe:2,detail:1,brush:5,half:0},Ms=4,As=30,si=.5,ni={1:3,2:2,3:2,4:2},Us=[.005181516702338386,.005181516702338386,.006995410187265387],ut=class e{constructor(t,r,i,s,n,a){this.gpu=t;this.smoke=r;this.painting=i;this.plain=s;this.pipelines=n;this.format=a;let l=r.lower.map((c,h)=>r.upper[h]-c);this.brushed=t.buffer(4*l[0]*l[1]*l[2],"the mix of two rules"),this.brush=t.uniform(64),this.hit=t.buffer(16,"a point"),this.screen=t.uniform(32),this.sampler=t.device.createSampler({magFilter:"linear",minFilter:"linear"}),this.camera=this.framed(1)}gpu;smoke;painting;plain;pipelines;format;settings={...me};camera;at=-1;layers=[];samples=0;buffers=null;stale={state:!0,look:!0};picture=null;brushed;brush;hit;screen;sampler;static async create(t,r,i){let s=`const PLANES = 1u;
${D}${Y}${Nt}`,[n,a,l,c,h]=await Promise.all([ze.create(t,r),ze.create(t,r),t.compute(s,"meet"),t.compute(s,"blend"),t.render(Vr,"present",i)]);return new e(t,r,n,a,{meet:l,blend:c,present:h},i)}framed(t,r=0,i=5){let[s,n]=Ft(this.smoke,this.smoke.toWorld);return zr(s,n,r,i,t,As)}async use(t,r){let i=this.settings.half>0,s=t===null?null:await ct.create(this.gpu,t,this.smoke,i);this.layers[r]?.destroy(),s===null?this.layers.length=r:(this.layers[r]=s,this.buffers!==null&&this.begin(s)),this.stale.state=!0}get guide(){let{guide:t,guideAzimuth:r,guideElevation:i}=this.settings,[,,s]=O(r,-i);return{direction:s,amount:t}}begin(t){t.enter(this.buffers,this.guide,0),this.frameSteps(t,this.settings.warmup)}frameSteps(t,r){let i=this.settings.steps||t.rule.steps;t.step(r+i,this.settings.seed)}async show(t){this.enterFrame(await this.smoke.frame(t),t)}enterFrame(t,r){let i=this.passed(t,r);this.release(),this.buffers=this.upload(t),this.at=r;for(let s of this.layers){let n=s.sites===null||s.sites.cells===0;s.enter(this.buffers,this.guide,i*this.patternSpeed(s)),this.frameSteps(s,n?this.settings.warmup:0)}this.stale.state=!0,r+1<this.smoke.length&&this.smoke.frame(r+1).catch(()=>{})}passed(t,r){if(this.buffers===null)return 0;let i=t.number-this.buffers.frame.number;return r===this.at+1||Math.abs(i)<=Ms?i:0}patternSpeed({rule:t}){let{patternSpeed:r}=this.settings;return r<0?Number(t.transport):r}async restart(){for(let t of this.layers)t.reset();this.gpu.write(this.brushed,new Float32Array(this.brushed.size/4)),await this.show(0)}upload(t){let{gpu:r,smoke:i}=this,s=i.lower.map(u=>Math.floor(u/8)),n=i.upper.map((u,f)=>Math.floor((u-1)/8)+1-s[f]),a=new Uint32Array(n[0]*n[1]*n[2]).fill(4294967295);for(let u=0;u<t.count;u++){let[f,p,b]=[0,1,2].map(S=>t.bricks[3*u+S]-s[S]);a[(f*n[1]+p)*n[2]+b]=u}let l=new Uint8Array(a.byteLength+t.planes.length);l.set(new Uint8Array(a.buffer)),l.set(t.planes,a.byteLength);let c=new ArrayBuffer(64),h=new Int32Array(c),d=new Float32Array(c);h.set(i.lower),d[3]=i.density,h.set(i.upper,4),d[7]=i.speed,h.set([...s,t.count,...n],8);let m=r.uniform(64);return r.write(m,new Uint8Array(c)),{frame:t,uniform:m,bytes:r.buffer(l,"the smoke")}}step(t){for(let r of this.layers)r.step(t,this.settings.seed);this.stale.state=!0}conditionAgain(){if(this.buffers!==null)for(let t of this.layers)t.condition(this.buffers,this.guide)}lookAgain(){this.stale.look=!0}look(t=!1){let r=this.settings,[i]=this.layers;return{strength:t?0:r.strength,densityStrength:r.densityStrength,gamma:i.rule.gamma*r.density,light:{strength:r.light,azimuth:r.lightAzimuth,elevation:r.lightElevation,ambient:r.ambient},isPlain:t,mixed:r.mix}}get parts(){if(!this.layers.every(s=>s.rule.decoder.length>0))return 1;let t=this.gpu.device.limits.maxStorageBufferBindingSize,r=Math.max(...this.layers.map(s=>s.shown)),i=this.settings.detail;for(;i>1&&16*r*i**3>t;)i--;return i}prepare(){if(this.buffers===null||this.layers.length===0)return;let{parts:t}=this;if(t!==this.painting.refinement&&(this.stale.state=!0),this.stale.state){let r=this.samples||ni[t];for(let i of this.layers)i.paint(t,Math.min(r,ni[t]))}if((this.stale.state||this.stale.look)&&(this.painting.refine(t),this.painting.draw(this.buffers,this.layers,this.brushed,this.look()),this.settings.wipe<1)){this.plain.refine(1);let[r]=this.layers;this.plain.draw(this.buffers,[r],this.brushed,this.look(!0))}this.stale={state:!1,look:!1}}take(t,r){this.prepare(),(this.picture?.width!==t||this.picture.height!==r)&&(this.picture?.destroy(),this.picture=this.gpu.device.createTexture({size:[t,r],format:Gt,usage:GPUTextureUsage.RENDER_ATTACHMENT|GPUTextureUsage.TEXTURE_BINDING|GPUTextureUsage.COPY_SRC}));let i=this.picture;if(this.buffers===null||this.layers.length===0)return i;let s=Math.min(this.settings.wipe,1);return this.gpu.submit(n=>{let{camera:a}=this;this.painting.take(n,i,a,this.look(),si,[0,s]),s<1&&this.plain.take(n,i,a,this.look(!0),si,[s,1],!1)}),i}present(t,r,i,s){let{present:n}=this.pipelines,a=this.settings,l=a.light>0?1:0,c=[...Us,l,2**a.exposure,a.wipe,i,s];this.gpu.write(this.screen,new Float32Array(c)),this.gpu.submit(h=>{let d=h.beginRenderPass({colorAttachments:[{view:r,loadOp:"clear",storeOp:"store",clearValue:[0,0,0,1]}]});d.setPipeline(n);let m=this.gpu.bound(n,0,{0:this.screen,1:t.createView(),2:this.sampler});d.setBindGroup(0,m),d.draw(3),d.end()})}async pixels(t,r){let i=this.take(t,r),{device:s}=this.gpu,n=GPUTextureUsage.RENDER_ATTACHMENT|GPUTextureUsage.COPY_SRC,a=s.createTexture({size:[t,r],format:this.format,usage:n});this.present(i,a.createView(),t,r);let l=new Uint8ClampedArray(await this.gpu.pixels(a,4));if(a.destroy(),this.format==="bgra8unorm")for(let c=0;c<l.length;c+=4)[l[c],l[c+2]]=[l[c+2],l[c]];return l}async touch(t,[r,i],s){if(this.buffers===null||this.layers.length===0)return;this.prepare();let{gpu:n,smoke:a}=this,[l,c,h]=O(this.camera.azimuth,this.camera.elevation),d=2*se(this.camera.fieldOfView),m=N(N(h,l,r*s*d),c,i*d),u=ht(a,I(m,1/Math.hypot(...m))),{parts:f}=this,p=this.look().gamma/f;n.write(this.brush,new Float32Array([...this.painting.place(st(this.camera)),this.settings.brush,...u,p,...this.painting.cells,f,t==="less"?-.5:.5,0,0,0]));let{meet:b}=this.pipelines,S=this.painting.texture3d.createView(),P=n.bound(b,1,{0:this.brush,1:S,2:this.hit});n.submit(A=>R(A,b,[n.bound(b,0,{}),P],1)),t==="erase"?await this.erase():this.blend()}async erase(){let{gpu:t}=this;for(let r of this.layers){let i=`const PLANES = ${W(r.rule.channels)}u;
`,s=await t.compute(`${i}${D}${Y}${Nt}`,"erase");if(r.sites===null||r.sites.cells===0||this.buffers===null)continue;let n=[t.bound(s,0,{0:r.uniform,1:r.places}),t.bound(s,1,{0:this.brush,2:this.hit,3:r.state}),t.bound(s,2,{0:this.buffers.uniform})],a=r.sites.cells;t.submit(l=>R(l,s,n,Math.ceil(a/64)))}this.stale.state=!0}blend(){let{gpu:t,smoke:r}=this,{blend:i}=this.pipelines,s=r.lower.map((a,l)=>Math.ceil((r.upper[l]-a)/4)),n=[t.bound(i,0,{}),t.bound(i,1,{0:this.brush,2:this.hit,4:this.brushed}),t.bound(i,2,{0:this.buffers.uniform})];t.submit(a=>R(a,i,n,s)),this.stale.look=!0}release(){this.buffers?.uniform.destroy(),this.buffers?.bytes.destroy(),this.buffers=null}destroy(){this.release();for(let t of this.layers)t.destroy();this.painting.destroy(),this.plain.destroy();for(let t of[this.picture,this.brushed,this.brush,this.hit,this.screen])t?.destroy()}};var ai=Object.keys(me),oi=["azimuth","elevation","distance"],Ls={detail:[1,4],strength:[0,1],densityStrength:[0,1],steps:[0,256],warmup:[0,4096],patternSpeed:[-1,8],density:[.001,1e3],light:[0,20],ambient:[0,1],half:[0,1]};function li(e){let t=new URLSearchParams,{settings:r,camera:i,at:s}=e.stage;e.names[0]!==e.show.rules[0].name&&t.set("rule",e.names[0]),e.names[1]&&t.set("with",e.names[1]);for(let a of ai)e.isDefault(a)||t.set(a,$t(r[a]));for(let a of oi)t.set(a,$t(i[a]));t.set("target",i.target.map($t).join(",")),s>0&&t.set("frame",String(s));let n=new URL(location.href);return n.hash=t.toString(),n.href}async function Ot(e,t){let r=new URLSearchParams(t.replace(/^#/,"")),i=h=>{let d=Number(r.get(h));return r.has(h)&&Number.isFinite(d)?d:null},{settings:s,camera:n}=e.stage;for(let h of ai){let d=i(h);if(d===null)continue;let[m,u]=Ls[h]??[-1e6,1e6];s[h]=Math.min(Math.max(d,m),u)}s.detail=Math.round(s.detail);for(let h of oi){let d=i(h);d!==null&&(h!=="distance"||d>0)&&(n[h]=d)}let a=(r.get("target")??"").split(",").map(Number);a.length===3&&a.every(Number.isFinite)&&(n.target=a);let l=h=>e.show.rules.some(d=>d.name===h)?h:null;await e.use(l(r.get("rule"))??e.show.rules[0].name,0);let c=l(r.get("with"));c!==null&&await e.use(c,1),await e.goTo(Math.round(i("frame")??0))}function $t(e){return String(Number(e.toPrecision(6)))}var tr=(e,t,r)=>{if(!t.has(e))throw TypeError("Cannot "+r)},o=(e,t,r)=>(tr(e,t,"read from private field"),r?r.call(e):t.get(e)),g=(e,t,r)=>{if(t.has(e))throw TypeError("Cannot add the same private member more than once");t instanceof WeakSet?t.add(e):t.set(e,r)},k=(e,t,r,i)=>(tr(e,t,"write to private field"),i?i.call(e,r):t.set(e,r),r),w=(e,t,r)=>(tr(e,t,"access private method"),r),hi=class{constructor(e){this.value=e}},rr=class{constructor(e){this.value=e}},ui=e=>e<256?1:e<65536?2:e<1<<24?3:e<2**32?4:e<2**40?5:6,Cs=e=>{if(e<127)return 1;if(e<16383)return 2;if(e<(1<<21)-1)return 3;if(e<(1<<28)-1)return 4;if(e<2**35-1)return 5;if(e<2**42-1)return 6;throw new Error("EBML VINT size not supported "+e)},pe=(e,t,r)=>{let i=0;for(let s=t;s<r;s++){let n=Math.floor(s/8),a=e[n],l=7-(s&7),c=(a&1<<l)>>l;i<<=1,i|=c}return i},zs=(e,t,r,i)=>{for(let s=t;s<r;s++){let n=Math.floor(s/8),a=e[n],l=7-(s&7);a&=~(1<<l),a|=(i&1<<r-s-1)>>r-s-1<<l,e[n]=a}};var Et=class{},ir=class extends Et{constructor(){super(...arguments),this.buffer=null}},di=class extends Et{constructor(e){if(super(),this.options=e,typeof e!="object")throw new TypeError("StreamTarget requires an options object to be passed to its constructor.");if(e.onData){if(typeof e.onData!="function")throw new TypeError("options.onData, when provided, must be a function.");if(e.onData.length<2)throw new TypeError("options.onData, when provided, must be a function that takes in at least two arguments (data and position). Ignoring the position argument, which specifies the byte offset at which the data is to be written, can lead to broken outputs.")}if(e.onHeader&&typeof e.onHeader!="function")throw new TypeError("options.onHeader, when provided, must be a function.");if(e.onCluster&&typeof e.onCluster!="function")throw new TypeError("options.onCluster, when provided, must be a function.");if(e.chunked!==void 0&&typeof e.chunked!="boolean")throw new TypeError("options.chunked, when provided, must be a boolean.");if(e.chunkSize!==void 0&&(!Number.isInteger(e.chunkSize)||e.chunkSize<1024))throw new TypeError("options.chunkSize, when provided, must be an integer and not smaller than 1024.")}},Bs=class extends Et{constructor(e,t){if(super(),this.stream=e,this.options=t,!(e instanceof FileSystemWritableFileStream))throw new TypeError("FileSystemWritableFileStreamTarget requires a FileSystemWritableFileStream instance.");if(t!==void 0&&typeof t!="object")throw new TypeError("FileSystemWritableFileStreamTarget's options, when provided, must be an object.");if(t&&t.chunkSize!==void 0&&(!Number.isInteger(t.chunkSize)||t.chunkSize<=0))throw new TypeError("options.chunkSize, when provided, must be a positive integer")}},te,E,Dt,fi,Ht,mi,jt,pi,dt,Kt,qt,gi,bi=class{constructor(){g(this,Dt),g(this,Ht),g(this,jt),g(this,dt),g(this,qt),this.pos=0,g(this,te,new Uint8Array(8)),g(this,E,new DataView(o(this,te).buffer)),this.offsets=new WeakMap,this.dataOffsets=new WeakMap}seek(e){this.pos=e}writeEBMLVarInt(e,t=Cs(e)){let r=0;switch(t){case 1:o(this,E).setUint8(r++,128|e);break;case 2:o(this,E).setUint8(r++,64|e>>8),o(this,E).setUint8(r++,e);break;case 3:o(this,E).setUint8(r++,32|e>>16),o(this,E).setUint8(r++,e>>8),o(this,E).setUint8(r++,e);break;case 4:o(this,E).setUint8(r++,16|e>>24),o(this,E).setUint8(r++,e>>16),o(this,E).setUint8(r++,e>>8),o(this,E).setUint8(r++,e);break;case 5:o(this,E).setUint8(r++,8|e/2**32&7),o(this,E).setUint8(r++,e>>24),o(this,E).setUint8(r++,e>>16),o(this,E).setUint8(r++,e>>8),o(this,E).setUint8(r++,e);break;case 6:o(this,E).setUint8(r++,4|e/2**40&3),o(this,E).setUint8(r++,e/2**32|0),o(this,E).setUint8(r++,e>>24),o(this,E).setUint8(r++,e>>16),o(this,E).setUint8(r++,e>>8),o(this,E).setUint8(r++,e);break;default:throw new Error("Bad EBML VINT size "+t)}this.write(o(this,te).subarray(0,r))}writeEBML(e){if(e!==null)if(e instanceof Uint8Array)this.write(e);else if(Array.isArray(e))for(let t of e)this.writeEBML(t);else if(this.offsets.set(e,this.pos),w(this,dt,Kt).call(this,e.id),Array.isArray(e.data)){let t=this.pos,r=e.size===-1?1:e.size??4;e.size===-1?w(this,Dt,fi).call(this,255):this.seek(this.pos+r);let i=this.pos;if(this.dataOffsets.set(e,i),this.writeEBML(e.data),e.size!==-1){let s=this.pos-i,n=this.pos;this.seek(t),this.writeEBMLVarInt(s,r),this.seek(n)}}else if(typeof e.data=="number"){let t=e.size??ui(e.data);this.writeEBMLVarInt(t),w(this,dt,Kt).call(this,e.data,t)}else typeof e.data=="string"?(this.writeEBMLVarInt(e.data.length),w(this,qt,gi).call(this,e.data)):e.data instanceof Uint8Array?(this.writeEBMLVarInt(e.data.byteLength,e.size),this.write(e.data)):e.data instanceof hi?(this.writeEBMLVarInt(4),w(this,Ht,mi).call(this,e.data.value)):e.data instanceof rr&&(this.writeEBMLVarInt(8),w(this,jt,pi).call(this,e.data.value))}};te=new WeakMap;E=new WeakMap;Dt=new WeakSet;fi=function(e){o(this,E).setUint8(0,e),this.write(o(this,te).subarray(0,1))};Ht=new WeakSet;mi=function(e){o(this,E).setFloat32(0,e,!1),this.write(o(this,te).subarray(0,4))};jt=new WeakSet;pi=function(e){o(this,E).setFloat64(0,e,!1),this.write(o(this,te))};dt=new WeakSet;Kt=function(e,t=ui(e)){let r=0;switch(t){case 6:o(this,E).setUint8(r++,e/2**40|0);case 5:o(this,E).setUint8(r++,e/2**32|0);case 4:o(this,E).setUint8(r++,e>>24);case 3:o(this,E).setUint8(r++,e>>16);case 2:o(this,E).setUint8(r++,e>>8);case 1:o(this,E).setUint8(r++,e);break;default:throw new Error("Bad UINT size "+t)}this.write(o(this,te).subarray(0,r))};qt=new WeakSet;gi=function(e){this.write(new Uint8Array(e.split("").map(t=>t.charCodeAt(0))))};var ft,he,He,mt,Yt,Ns=class extends bi{constructor(e){super(),g(this,mt),g(this,ft,void 0),g(this,he,new ArrayBuffer(2**16)),g(this,He,new Uint8Array(o(this,he))),k(this,ft,e)}write(e){w(this,mt,Yt).call(this,this.pos+e.byteLength),o(this,He).set(e,this.pos),this.pos+=e.byteLength}finalize(){w(this,mt,Yt).call(this,this.pos),o(this,ft).buffer=o(this,he).slice(0,this.pos)}};ft=new WeakMap;he=new WeakMap;He=new WeakMap;mt=new WeakSet;Yt=function(e){let t=o(this,he).byteLength;for(;t<e;)t*=2;if(t===o(this,he).byteLength)return;let r=new ArrayBuffer(t),i=new Uint8Array(r);i.set(o(this,He),0),k(this,he,r),k(this,He,i)};var ge,H,j,ne,Qe=class extends bi{constructor(e){super(),this.target=e,g(this,ge,!1),g(this,H,void 0),g(this,j,void 0),g(this,ne,void 0)}write(e){if(!o(this,ge))return;let t=this.pos;if(t<o(this,j)){if(t+e.byteLength<=o(this,j))return;e=e.subarray(o(this,j)-t),t=0}let r=t+e.byteLength-o(this,j),i=o(this,H).byteLength;for(;i<r;)i*=2;if(i!==o(this,H).byteLength){let s=new Uint8Array(i);s.set(o(this,H),0),k(this,H,s)}o(this,H).set(e,t-o(this,j)),k(this,ne,Math.max(o(this,ne),t+e.byteLength))}startTrackingWrites(){k(this,ge,!0),k(this,H,new Uint8Array(2**10)),k(this,j,this.pos),k(this,ne,this.pos)}getTrackedWrites(){if(!o(this,ge))throw new Error("Can't get tracked writes since nothing was tracked.");let t={data:o(this,H).subarray(0,o(this,ne)-o(this,j)),start:o(this,j),end:o(this,ne)};return k(this,H,void 0),k(this,ge,!1),t}};ge=new WeakMap;H=new WeakMap;j=new WeakMap;ne=new WeakMap;var Is=2**24,Ws=2,ae,ve,Re,Be,J,V,wt,Xt,sr,wi,nr,yi,Ve,yt,ar=class extends Qe{constructor(e,t){super(e),g(this,wt),g(this,sr),g(this,nr),g(this,Ve),g(this,ae,[]),g(this,ve,0),g(this,Re,void 0),g(this,Be,void 0),g(this,J,void 0),g(this,V,[]),k(this,Re,t),k(this,Be,e.options?.chunked??!1),k(this,J,e.options?.chunkSize??Is)}write(e){super.write(e),o(this,ae).push({data:e.slice(),start:this.pos}),this.pos+=e.byteLength}flush(){if(o(this,ae).length===0)return;let e=[],t=[...o(this,ae)].sort((r,i)=>r.start-i.start);e.push({start:t[0].start,size:t[0].data.byteLength});for(let r=1;r<t.length;r++){let i=e[e.length-1],s=t[r];s.start<=i.start+i.size?i.size=Math.max(i.size,s.start+s.data.byteLength-i.start):e.push({start:s.start,size:s.data.byteLength})}for(let r of e){r.data=new Uint8Array(r.size);for(let i of o(this,ae))r.start<=i.start&&i.start<r.start+r.size&&r.data.set(i.data,i.start-r.start);if(o(this,Be))w(this,wt,Xt).call(this,r.data,r.start),w(this,Ve,yt).call(this);else{if(o(this,Re)&&r.start<o(this,ve))throw new Error("Internal error: Monotonicity violation.");this.target.options.onData?.(r.data,r.start),k(this,ve,r.start+r.data.byteLength)}}o(this,ae).length=0}finalize(){o(this,Be)&&w(this,Ve,yt).call(this,!0)}};ae=new WeakMap;ve=new WeakMap;Re=new WeakMap;Be=new WeakMap;J=new WeakMap;V=new WeakMap;wt=new WeakSet;Xt=function(e,t){let r=o(this,V).findIndex(l=>l.start<=t&&t<l.start+o(this,J));r===-1&&(r=w(this,nr,yi).call(this,t));let i=o(this,V)[r],s=t-i.start,n=e.subarray(0,Math.min(o(this,J)-s,e.byteLength));i.data.set(n,s);let a={start:s,end:s+n.byteLength};if(w(this,sr,wi).call(this,i,a),i.written[0].start===0&&i.written[0].end===o(this,J)&&(i.shouldFlush=!0),o(this,V).length>Ws){for(let l=0;l<o(this,V).length-1;l++)o(this,V)[l].shouldFlush=!0;w(this,Ve,yt).call(this)}n.byteLength<e.byteLength&&w(this,wt,Xt).call(this,e.subarray(n.byteLength),t+n.byteLength)};sr=new WeakSet;wi=function(e,t){let r=0,i=e.written.length-1,s=-1;for(;r<=i;){let n=Math.floor(r+(i-r+1)/2);e.written[n].start<=t.start?(r=n+1,s=n):i=n-1}for(e.written.splice(s+1,0,t),(s===-1||e.written[s].end<t.start)&&s++;s<e.written.length-1&&e.written[s].end>=e.written[s+1].start;)e.written[s].end=Math.max(e.written[s].end,e.written[s+1].end),e.written.splice(s+1,1)};nr=new WeakSet;yi=function(e){let r={start:Math.floor(e/o(this,J))*o(this,J),data:new Uint8Array(o(this,J)),written:[],shouldFlush:!1};return o(this,V).push(r),o(this,V).sort((i,s)=>i.start-s.start),o(this,V).indexOf(r)};Ve=new WeakSet;yt=function(e=!1){for(let t=0;t<o(this,V).length;t++){let r=o(this,V)[t];if(!(!r.shouldFlush&&!e)){for(let i of r.written){if(o(this,Re)&&r.start+i.start<o(this,ve))throw new Error("Internal error: Monotonicity violation.");this.target.options.onData?.(r.data.subarray(i.start,i.end),r.start+i.start),k(this,ve,r.start+i.end)}o(this,V).splice(t--,1)}}};var Rs=class extends ar{constructor(e,t){super(new di({onData:(r,i)=>e.stream.write({type:"write",data:r,position:i}),chunked:!0,chunkSize:e.options?.chunkSize}),t)}},Pe=1,je=2,vt=3,Vs=1,Gs=2,Fs=17,$s=2**15,Ge=2**13,ci="webm-muxer",vi=6,ki=5,Os=["strict","offset","permissive"],v,y,Ke,qe,Q,Me,be,ue,Ae,re,ke,xe,q,Je,Se,Z,ee,oe,Fe,$e,Ee,Te,kt,Ye,Oe,Qt,xi,Jt,Si,or,Ei,lr,Ti,cr,_i,hr,Pi,ur,Mi,Tt,dr,_t,fr,mr,Ai,le,we,ce,ye,Zt,Ui,er,Li,Ne,pt,Ie,gt,pr,Ci,K,X,_e,Xe,De,xt,gr,zi,St,br,We,bt,Bi=class{constructor(e){g(this,Qt),g(this,Jt),g(this,or),g(this,lr),g(this,cr),g(this,hr),g(this,ur),g(this,Tt),g(this,_t),g(this,mr),g(this,le),g(this,ce),g(this,Zt),g(this,er),g(this,Ne),g(this,Ie),g(this,pr),g(this,K),g(this,_e),g(this,De),g(this,gr),g(this,St),g(this,We),g(this,v,void 0),g(this,y,void 0),g(this,Ke,void 0),g(this,qe,void 0),g(this,Q,void 0),g(this,Me,void 0),g(this,be,void 0),g(this,ue,void 0),g(this,Ae,void 0),g(this,re,void 0),g(this,ke,void 0),g(this,xe,void 0),g(this,q,void 0),g(this,Je,void 0),g(this,Se,0),g(this,Z,[]),g(this,ee,[]),g(this,oe,[]),g(this,Fe,void 0),g(this,$e,void 0),g(this,Ee,-1),g(this,Te,-1),g(this,kt,-1),g(this,Ye,void 0),g(this,Oe,!1),w(this,Qt,xi).call(this,e),k(this,v,{type:"webm",firstTimestampBehavior:"strict",...e}),this.target=e.target;let t=!!o(this,v).streaming;if(e.target instanceof ir)k(this,y,new Ns(e.target));else if(e.target instanceof di)k(this,y,new ar(e.target,t));else if(e.target instanceof Bs)k(this,y,new Rs(e.target,t));else throw new Error(`Invalid target: ${e.target}`);w(this,Jt,Si).call(this)}addVideoChunk(e,t,r){if(!(e instanceof EncodedVideoChunk))throw new TypeError("addVideoChunk's first argument (chunk) must be of type EncodedVideoChunk.");if(t&&typeof t!="object")throw new TypeError("addVideoChunk's second argument (meta), when provided, must be an object.");if(r!==void 0&&(!Number.isFinite(r)||r<0))throw new TypeError("addVideoChunk's third argument (timestamp), when provided, must be a non-negative real number.");let i=new Uint8Array(e.byteLength);e.copyTo(i),this.addVideoChunkRaw(i,e.type,r??e.timestamp,t)}addVideoChunkRaw(e,t,r,i){if(!(e instanceof Uint8Array))throw new TypeError("addVideoChunkRaw's first argument (data) must be an instance of Uint8Array.");if(t!=="key"&&t!=="delta")throw new TypeError("addVideoChunkRaw's second argument (type) must be either 'key' or 'delta'.");if(!Number.isFinite(r)||r<0)throw new TypeError("addVideoChunkRaw's third argument (timestamp) must be a non-negative real number.");if(i&&typeof i!="object")throw new TypeError("addVideoChunkRaw's fourth argument (meta), when provided, must be an object.");if(w(this,We,bt).call(this),!o(this,v).video)throw new Error("No video track declared.");o(this,Fe)===void 0&&k(this,Fe,r),i&&w(this,Zt,Ui).call(this,i);let s=w(this,Ie,gt).call(this,e,t,r,Pe);for(o(this,v).video.codec==="V_VP9"&&w(this,er,Li).call(this,s),k(this,Ee,s.timestamp);o(this,ee).length>0&&o(this,ee)[0].timestamp<=s.timestamp;){let n=o(this,ee).shift();w(this,K,X).call(this,n,!1)}!o(this,v).audio||s.timestamp<=o(this,Te)?w(this,K,X).call(this,s,!0):o(this,Z).push(s),w(this,Ne,pt).call(this),w(this,le,we).call(this)}addAudioChunk(e,t,r){if(!(e instanceof EncodedAudioChunk))throw new TypeError("addAudioChunk's first argument (chunk) must be of type EncodedAudioChunk.");if(t&&typeof t!="object")throw new TypeError("addAudioChunk's second argument (meta), when provided, must be an object.");if(r!==void 0&&(!Number.isFinite(r)||r<0))throw new TypeError("addAudioChunk's third argument (timestamp), when provided, must be a non-negative real number.");let i=new Uint8Array(e.byteLength);e.copyTo(i),this.addAudioChunkRaw(i,e.type,r??e.timestamp,t)}addAudioChunkRaw(e,t,r,i){if(!(e instanceof Uint8Array))throw new TypeError("addAudioChunkRaw's first argument (data) must be an instance of Uint8Array.");if(t!=="key"&&t!=="delta")throw new TypeError("addAudioChunkRaw's second argument (type) must be either 'key' or 'delta'.");if(!Number.isFinite(r)||r<0)throw new TypeError("addAudioChunkRaw's third argument (timestamp) must be a non-negative real number.");if(i&&typeof i!="object")throw new TypeError("addAudioChunkRaw's fourth argument (meta), when provided, must be an object.");if(w(this,We,bt).call(this),!o(this,v).audio)throw new Error("No audio track declared.");o(this,$e)===void 0&&k(this,$e,r),i?.decoderConfig&&(o(this,v).streaming?k(this,re,w(this,_e,Xe).call(this,i.decoderConfig.description)):w(this,De,xt).call(this,o(this,re),i.decoderConfig.description));let s=w(this,Ie,gt).call(this,e,t,r,je);for(k(this,Te,s.timestamp);o(this,Z).length>0&&o(this,Z)[0].timestamp<=s.timestamp;){let n=o(this,Z).shift();w(this,K,X).call(this,n,!0)}!o(this,v).video||s.timestamp<=o(this,Ee)?w(this,K,X).call(this,s,!o(this,v).video):o(this,ee).push(s),w(this,Ne,pt).call(this),w(this,le,we).call(this)}addSubtitleChunk(e,t,r){if(typeof e!="object"||!e)throw new TypeError("addSubtitleChunk's first argument (chunk) must be an object.");if(!(e.body instanceof Uint8Array))throw new TypeError("body must be an instance of Uint8Array.");if(!Number.isFinite(e.timestamp)||e.timestamp<0)throw new TypeError("timestamp must be a non-negative real number.");if(!Number.isFinite(e.duration)||e.duration<0)throw new TypeError("duration must be a non-negative real number.");if(e.additions&&!(e.additions instanceof Uint8Array))throw new TypeError("additions, when present, must be an instance of Uint8Array.");if(typeof t!="object")throw new TypeError("addSubtitleChunk's second argument (meta) must be an object.");if(w(this,We,bt).call(this),!o(this,v).subtitles)throw new Error("No subtitle track declared.");t?.decoderConfig&&(o(this,v).streaming?k(this,ke,w(this,_e,Xe).call(this,t.decoderConfig.description)):w(this,De,xt).call(this,o(this,ke),t.decoderConfig.description));let i=w(this,Ie,gt).call(this,e.body,"key",r??e.timestamp,vt,e.duration,e.additions);k(this,kt,i.timestamp),o(this,oe).push(i),w(this,Ne,pt).call(this),w(this,le,we).call(this)}finalize(){if(o(this,Oe))throw new Error("Cannot finalize a muxer more than once.");for(;o(this,Z).length>0;)w(this,K,X).call(this,o(this,Z).shift(),!0);for(;o(this,ee).length>0;)w(this,K,X).call(this,o(this,ee).shift(),!0);for(;o(this,oe).length>0&&o(this,oe)[0].timestamp<=o(this,Se);)w(this,K,X).call(this,o(this,oe).shift(),!1);if(o(this,q)&&w(this,St,br).call(this),o(this,y).writeEBML(o(this,xe)),!o(this,v).streaming){let e=o(this,y).pos,t=o(this,y).pos-o(this,ce,ye);o(this,y).seek(o(this,y).offsets.get(o(this,Ke))+4),o(this,y).writeEBMLVarInt(t,vi),o(this,be).data=new rr(o(this,Se)),o(this,y).seek(o(this,y).offsets.get(o(this,be))),o(this,y).writeEBML(o(this,be)),o(this,Q).data[0].data[1].data=o(this,y).offsets.get(o(this,xe))-o(this,ce,ye),o(this,Q).data[1].data[1].data=o(this,y).offsets.get(o(this,qe))-o(this,ce,ye),o(this,Q).data[2].data[1].data=o(this,y).offsets.get(o(this,Me))-o(this,ce,ye),o(this,y).seek(o(this,y).offsets.get(o(this,Q))),o(this,y).writeEBML(o(this,Q)),o(this,y).seek(e)}w(this,le,we).call(this),o(this,y).finalize(),k(this,Oe,!0)}};v=new WeakMap;y=new WeakMap;Ke=new WeakMap;qe=new WeakMap;Q=new WeakMap;Me=new WeakMap;be=new WeakMap;ue=new WeakMap;Ae=new WeakMap;re=new WeakMap;ke=new WeakMap;xe=new WeakMap;q=new WeakMap;Je=new WeakMap;Se=new WeakMap;Z=new WeakMap;ee=new WeakMap;oe=new WeakMap;Fe=new WeakMap;$e=new WeakMap;Ee=new WeakMap;Te=new WeakMap;kt=new WeakMap;Ye=new WeakMap;Oe=new WeakMap;Qt=new WeakSet;xi=function(e){if(typeof e!="object")throw new TypeError("The muxer requires an options object to be passed to its constructor.");if(!(e.target instanceof Et))throw new TypeError("The target must be provided and an instance of Target.");if(e.video){if(typeof e.video.codec!="string")throw new TypeError(`Invalid video codec: ${e.video.codec}. Must be a string.`);if(!Number.isInteger(e.video.width)||e.video.width<=0)throw new TypeError(`Invalid video width: ${e.video.width}. Must be a positive integer.`);if(!Number.isInteger(e.video.height)||e.video.height<=0)throw new TypeError(`Invalid video height: ${e.video.height}. Must be a positive integer.`);if(e.video.frameRate!==void 0&&(!Number.isFinite(e.video.frameRate)||e.video.frameRate<=0))throw new TypeError(`Invalid video frame rate: ${e.video.frameRate}. Must be a positive number.`);if(e.video.alpha!==void 0&&typeof e.video.alpha!="boolean")throw new TypeError(`Invalid video alpha: ${e.video.alpha}. Must be a boolean.`)}if(e.audio){if(typeof e.audio.codec!="string")throw new TypeError(`Invalid audio codec: ${e.audio.codec}. Must be a string.`);if(!Number.isInteger(e.audio.numberOfChannels)||e.audio.numberOfChannels<=0)throw new TypeError(`Invalid number of audio channels: ${e.audio.numberOfChannels}. Must be a positive integer.`);if(!Number.isInteger(e.audio.sampleRate)||e.audio.sampleRate<=0)throw new TypeError(`Invalid audio sample rate: ${e.audio.sampleRate}. Must be a positive integer.`);if(e.audio.bitDepth!==void 0&&(!Number.isInteger(e.audio.bitDepth)||e.audio.bitDepth<=0))throw new TypeError(`Invalid audio bit depth: ${e.audio.bitDepth}. Must be a positive integer.`)}if(e.subtitles&&typeof e.subtitles.codec!="string")throw new TypeError(`Invalid subtitles codec: ${e.subtitles.codec}. Must be a string.`);if(e.type!==void 0&&!["webm","matroska"].includes(e.type))throw new TypeError(`Invalid type: ${e.type}. Must be 'webm' or 'matroska'.`);if(e.firstTimestampBehavior&&!Os.includes(e.firstTimestampBehavior))throw new TypeError(`Invalid first timestamp behavior: ${e.firstTimestampBehavior}`);if(e.streaming!==void 0&&typeof e.streaming!="boolean")throw new TypeError(`Invalid streaming option: ${e.streaming}. Must be a boolean.`)};Jt=new WeakSet;Si=function(){o(this,y)instanceof Qe&&o(this,y).target.options.onHeader&&o(this,y).startTrackingWrites(),w(this,or,Ei).call(this),o(this,v).streaming||w(this,hr,Pi).call(this),w(this,ur,Mi).call(this),w(this,lr,Ti).call(this),w(this,cr,_i).call(this),o(this,v).streaming||(w(this,Tt,dr).call(this),w(this,_t,fr).call(this)),w(this,mr,Ai).call(this),w(this,le,we).call(this)};or=new WeakSet;Ei=function(){let e={id:440786851,data:[{id:17030,data:1},{id:17143,data:1},{id:17138,data:4},{id:17139,data:8},{id:17026,data:o(this,v).type??"webm"},{id:17031,data:2},{id:17029,data:2}]};o(this,y).writeEBML(e)};lr=new WeakSet;Ti=function(){k(this,Ae,{id:236,size:4,data:new Uint8Array(Ge)}),k(this,re,{id:236,size:4,data:new Uint8Array(Ge)}),k(this,ke,{id:236,size:4,data:new Uint8Array(Ge)})};cr=new WeakSet;_i=function(){k(this,ue,{id:21936,data:[{id:21937,data:2},{id:21946,data:2},{id:21947,data:2},{id:21945,data:0}]})};hr=new WeakSet;Pi=function(){let e=new Uint8Array([28,83,187,107]),t=new Uint8Array([21,73,169,102]),r=new Uint8Array([22,84,174,107]);k(this,Q,{id:290298740,data:[{id:19899,data:[{id:21419,data:e},{id:21420,size:5,data:0}]},{id:19899,data:[{id:21419,data:t},{id:21420,size:5,data:0}]},{id:19899,data:[{id:21419,data:r},{id:21420,size:5,data:0}]}]})};ur=new WeakSet;Mi=function(){let e={id:17545,data:new rr(0)};k(this,be,e);let t={id:357149030,data:[{id:2807729,data:1e6},{id:19840,data:ci},{id:22337,data:ci},o(this,v).streaming?null:e]};k(this,qe,t)};Tt=new WeakSet;dr=function(){let e={id:374648427,data:[]};k(this,Me,e),o(this,v).video&&e.data.push({id:174,data:[{id:215,data:Pe},{id:29637,data:Pe},{id:131,data:Vs},{id:134,data:o(this,v).video.codec},o(this,Ae),o(this,v).video.frameRate?{id:2352003,data:1e9/o(this,v).video.frameRate}:null,{id:224,data:[{id:176,data:o(this,v).video.width},{id:186,data:o(this,v).video.height},o(this,v).video.alpha?{id:21440,data:1}:null,o(this,ue)]}]}),o(this,v).audio&&(k(this,re,o(this,v).streaming?o(this,re)||null:{id:236,size:4,data:new Uint8Array(Ge)}),e.data.push({id:174,data:[{id:215,data:je},{id:29637,data:je},{id:131,data:Gs},{id:134,data:o(this,v).audio.codec},o(this,re),{id:225,data:[{id:181,data:new hi(o(this,v).audio.sampleRate)},{id:159,data:o(this,v).audio.numberOfChannels},o(this,v).audio.bitDepth?{id:25188,data:o(this,v).audio.bitDepth}:null]}]})),o(this,v).subtitles&&e.data.push({id:174,data:[{id:215,data:vt},{id:29637,data:vt},{id:131,data:Fs},{id:134,data:o(this,v).subtitles.codec},o(this,ke)]})};_t=new WeakSet;fr=function(){let e={id:408125543,size:o(this,v).streaming?-1:vi,data:[o(this,v).streaming?null:o(this,Q),o(this,qe),o(this,Me)]};if(k(this,Ke,e),o(this,y).writeEBML(e),o(this,y)instanceof Qe&&o(this,y).target.options.onHeader){let{data:t,start:r}=o(this,y).getTrackedWrites();o(this,y).target.options.onHeader(t,r)}};mr=new WeakSet;Ai=function(){k(this,xe,{id:475249515,data:[]})};le=new WeakSet;we=function(){o(this,y)instanceof ar&&o(this,y).flush()};ce=new WeakSet;ye=function(){return o(this,y).dataOffsets.get(o(this,Ke))};Zt=new WeakSet;Ui=function(e){if(e.decoderConfig){if(e.decoderConfig.colorSpace){let t=e.decoderConfig.colorSpace;if(k(this,Ye,t),o(this,ue).data=[{id:21937,data:{rgb:1,bt709:1,bt470bg:5,smpte170m:6}[t.matrix]},{id:21946,data:{bt709:1,smpte170m:6,"iec61966-2-1":13}[t.transfer]},{id:21947,data:{bt709:1,bt470bg:5,smpte170m:6}[t.primaries]},{id:21945,data:[1,2][Number(t.fullRange)]}],!o(this,v).streaming){let r=o(this,y).pos;o(this,y).seek(o(this,y).offsets.get(o(this,ue))),o(this,y).writeEBML(o(this,ue)),o(this,y).seek(r)}}e.decoderConfig.description&&(o(this,v).streaming?k(this,Ae,w(this,_e,Xe).call(this,e.decoderConfig.description)):w(this,De,xt).call(this,o(this,Ae),e.decoderConfig.description))}};er=new WeakSet;Li=function(e){if(e.type!=="key"||!o(this,Ye))return;let t=0;if(pe(e.data,0,2)!==2)return;t+=2;let r=(pe(e.data,t+1,t+2)<<1)+pe(e.data,t+0,t+1);t+=2,r===3&&t++;let i=pe(e.data,t+0,t+1);if(t++,i)return;let s=pe(e.data,t+0,t+1);if(t++,s!==0)return;t+=2;let n=pe(e.data,t+0,t+24);if(t+=24,n!==4817730)return;r>=2&&t++;let a={rgb:7,bt709:2,bt470bg:1,smpte170m:3}[o(this,Ye).matrix];zs(e.data,t+0,t+3,a)};Ne=new WeakSet;pt=function(){let e=Math.min(o(this,v).video?o(this,Ee):1/0,o(this,v).audio?o(this,Te):1/0),t=o(this,oe);for(;t.length>0&&t[0].timestamp<=e;)w(this,K,X).call(this,t.shift(),!o(this,v).video&&!o(this,v).audio)};Ie=new WeakSet;gt=function(e,t,r,i,s,n){let a=w(this,pr,Ci).call(this,r,i);return{data:e,additions:n,type:t,timestamp:a,duration:s,trackNumber:i}};pr=new WeakSet;Ci=function(e,t){let r=t===Pe?o(this,Ee):t===je?o(this,Te):o(this,kt);if(t!==vt){let i=t===Pe?o(this,Fe):o(this,$e);if(o(this,v).firstTimestampBehavior==="strict"&&r===-1&&e!==0)throw new Error(`The first chunk for your media track must have a timestamp of 0 (received ${e}). Non-zero first timestamps are often caused by directly piping frames or audio data from a MediaStreamTrack into the encoder. Their timestamps are typically relative to the age of the document, which is probably what you want.

If you want to offset all timestamps of a track such that the first one is zero, set firstTimestampBehavior: 'offset' in the options.
If you want to allow non-zero first timestamps, set firstTimestampBehavior: 'permissive'.
`);o(this,v).firstTimestampBehavior==="offset"&&(e-=i)}if(e<r)throw new Error(`Timestamps must be monotonically increasing (went from ${r} to ${e}).`);if(e<0)throw new Error(`Timestamps must be non-negative (received ${e}).`);return e};K=new WeakSet;X=function(e,t){o(this,v).streaming&&!o(this,Me)&&(w(this,Tt,dr).call(this),w(this,_t,fr).call(this));let r=Math.floor(e.timestamp/1e3),i=r-o(this,Je),s=t&&e.type==="key"&&i>=1e3,n=i>=$s;if((!o(this,q)||s||n)&&(w(this,gr,zi).call(this,r),i=0),i<0)return;let a=new Uint8Array(4),l=new DataView(a.buffer);if(l.setUint8(0,128|e.trackNumber),l.setInt16(1,i,!1),e.duration===void 0&&!e.additions){l.setUint8(3,+(e.type==="key")<<7);let c={id:163,data:[a,e.data]};o(this,y).writeEBML(c)}else{let c=Math.floor(e.duration/1e3),h={id:160,data:[{id:161,data:[a,e.data]},e.duration!==void 0?{id:155,data:c}:null,e.additions?{id:30113,data:e.additions}:null]};o(this,y).writeEBML(h)}k(this,Se,Math.max(o(this,Se),r))};_e=new WeakSet;Xe=function(e){return{id:25506,size:4,data:new Uint8Array(e)}};De=new WeakSet;xt=function(e,t){let r=o(this,y).pos;o(this,y).seek(o(this,y).offsets.get(e));let i=6+t.byteLength,s=Ge-i;if(s<0){let n=t.byteLength+s;t instanceof ArrayBuffer?t=t.slice(0,n):t=t.buffer.slice(0,n),s=0}e=[w(this,_e,Xe).call(this,t),{id:236,size:4,data:new Uint8Array(s)}],o(this,y).writeEBML(e),o(this,y).seek(r)};gr=new WeakSet;zi=function(e){o(this,q)&&w(this,St,br).call(this),o(this,y)instanceof Qe&&o(this,y).target.options.onCluster&&o(this,y).startTrackingWrites(),k(this,q,{id:524531317,size:o(this,v).streaming?-1:ki,data:[{id:231,data:e}]}),o(this,y).writeEBML(o(this,q)),k(this,Je,e);let t=o(this,y).offsets.get(o(this,q))-o(this,ce,ye);o(this,xe).data.push({id:187,data:[{id:179,data:e},o(this,v).video?{id:183,data:[{id:247,data:Pe},{id:241,data:t}]}:null,o(this,v).audio?{id:183,data:[{id:247,data:je},{id:241,data:t}]}:null]})};St=new WeakSet;br=function(){if(!o(this,v).streaming){let e=o(this,y).pos-o(this,y).dataOffsets.get(o(this,q)),t=o(this,y).pos;o(this,y).seek(o(this,y).offsets.get(o(this,q))+4),o(this,y).writeEBMLVarInt(e,ki),o(this,y).seek(t)}if(o(this,y)instanceof Qe&&o(this,y).target.options.onCluster){let{data:e,start:t}=o(this,y).getTrackedWrites();o(this,y).target.options.onCluster(e,t,o(this,Je))}};We=new WeakSet;bt=function(){if(o(this,Oe))throw new Error("Cannot add new video or audio chunks after the file has been finalized.")};var Ds=/(?:(\d{2}):)?(\d{2}):(\d{2}).(\d{3})/;var Qa=new TextEncoder,Hs,js,Ks,qs,Ys,Xs,Qs,Js,Zs;Hs=new WeakMap;js=new WeakMap;Ks=new WeakMap;qs=new WeakMap;Ys=new WeakMap;Xs=new WeakSet;Qs=function(e){let t=Ds.exec(e);if(!t)throw new Error("Expected match.");return 3600*1e3*Number(t[1]||"0")+60*1e3*Number(t[2])+1e3*Number(t[3])+Number(t[4])};Js=new WeakSet;Zs=function(e){let t=Math.floor(e/36e5),r=Math.floor(e%(3600*1e3)/(60*1e3)),i=Math.floor(e%(60*1e3)/1e3),s=e%1e3;return t.toString().padStart(2,"0")+":"+r.toString().padStart(2,"0")+":"+i.toString().padStart(2,"0")+"."+s.toString().padStart(3,"0")};var en=[["vp09.00.40.08","V_VP9"],["vp8","V_VP8"]],Ni=12e6,tn=24;function Ii({canvas:e}){let t=r=>2*Math.max(Math.round(r/2),8);return[t(e.width),t(e.height)]}async function Wi(e,t,r){return new ImageData(await e.stage.pixels(t,r),t,r)}async function Ri(e){let[t,r]=Ii(e),i=new OffscreenCanvas(t,r);return i.getContext("2d").putImageData(await Wi(e,t,r),0,0),i.convertToBlob({type:"image/png"})}async function Vi(e,t){if(!("VideoEncoder"in globalThis))throw new _("This browser encodes no films.");let[r,i]=Ii(e),s=e.smoke.fps*e.speed,[n,a]=await rn(r,i,s),l=new ir,c={codec:a,width:r,height:i,frameRate:s},h=new Bi({target:l,video:c}),d=null,m=new VideoEncoder({output:(u,f)=>h.addVideoChunk(u,f),error:u=>d=u});m.configure({codec:n,width:r,height:i,framerate:s,bitrate:Ni});for(let u=0;u<e.smoke.length;u++){u===0?await e.restart():await e.goTo(u);let f=Math.round(1e6*u/s),p=await Wi(e,r,i),b=new VideoFrame(p.data,{format:"RGBA",codedWidth:r,codedHeight:i,timestamp:f,duration:Math.round(1e6/s)});if(m.encode(b,{keyFrame:u%tn===0}),b.close(),d!==null)throw d;t((u+1)/e.smoke.length)}return await m.flush(),h.finalize(),new Blob([l.buffer],{type:"video/webm"})}async function rn(e,t,r){for(let i of en){let s={codec:i[0],width:e,height:t,framerate:r,bitrate:Ni};if((await VideoEncoder.isConfigSupported(s)).supported)return i}throw new _("This browser encodes no WebM films.")}function wr(e,t,r){let i=t.names.filter(Boolean).join("_"),s=r==="png"?`_${t.smoke.number(Math.max(t.stage.at,0))}`:"";Mr(e,`${t.smoke.name}_${i}${s}.${r}`.replace(/[^\w.-]+/g,"_"))}var ie={orbit:"M12 4a8 8 0 1 0 8 8M20 4v5h-5",erase:"M4 15l8.5-8.5 6 6L12 19H8zM9 10l6 6M8 19h12",more:"M12 4v16M4 12h16",less:"M4 12h16",beside:"M4 5h16v14H4zM12 5v14",alive:"M3 12h4l3-7 4 14 3-7h4",picture:"M4 7h4l1.5-2h5L16 7h4v12H4zM12 16.5a3.5 3.5 0 1 0 0-7 3.5 3.5 0 0 0 0 7z",film:"M4 6h11v12H4zM15 10.5l5-3v9l-5-3z",link:"M10 14a4 4 0 0 0 6 0l3-3a4 4 0 0 0-6-6l-1 1M14 10a4 4 0 0 0-6 0l-3 3a4 4 0 0 0 6 6l1-1",home:"M4 11l8-7 8 7M6 10v9h12v-9",settings:"M4 8h9M17 8h3M4 16h3M11 16h9M15 6v4M9 14v4"},sn=[["orbit","Turn, pan and zoom (1)"],["erase","Erase the painting; it heals (2)"],["more","Brush the second style on (3)"],["less","Brush the second style off (4)"]];function Gi(e){let t=sn.map(([n,a])=>{let l=F(a,ie[n],()=>Ue(e,n));return l.id=`tool-${n}`,[n,l]}),r=F("Beside the plain smoke (B)",ie.beside,()=>vr(e)),i=F("Goes on while nothing plays (L)",ie.alive,()=>kr(e)),s=()=>{for(let[n,a]of t)a.setAttribute("aria-pressed",String(e.tool===n));r.setAttribute("aria-pressed",String(e.stage.settings.wipe<1)),i.setAttribute("aria-pressed",String(e.isAlive)),e.canvas.dataset.tool=e.tool};return e.addEventListener("change",s),s(),x("div",{id:"tools",role:"toolbar","aria-label":"Tools"},...t.map(([,n])=>n),x("hr"),r,i,F("Frame the smoke (F)",ie.home,()=>e.reframe()),x("hr"),F("Save a picture (P)",ie.picture,()=>{xr(e)}),F("Save a film",ie.film,()=>{nn(e)}),F("Copy a link to what is seen (C)",ie.link,()=>{Sr(e)}),F("Settings (H)",ie.settings,yr))}function yr(){document.body.classList.toggle("bare")}function Ue(e,t){e.tool=t,e.changed()}function vr(e){e.set("wipe",e.stage.settings.wipe<1?2:.5)}function kr(e){e.isAlive=!e.isAlive,e.changed()}async function xr(e){try{wr(await Ri(e),e,"png")}catch(t){z(C(t))}}async function nn(e){let t=e.isAlive;e.pause(),e.isAlive=!1;try{let r=await Vi(e,i=>z(`Filming: ${Math.round(100*i)} %`));wr(r,e,"webm")}catch(r){z(C(r))}finally{e.isAlive=t}}async function Sr(e){let t=li(e);history.replaceState(null,"",t);try{await navigator.clipboard.writeText(t),z("The link is copied.")}catch{z("The link is in the address bar.")}}var Fi="M8 5.5v13l11-6.5z",an="M8 5.5v13M16 5.5v13",on="M18 6.5v11L9 12zM6.5 6.5v11",Er=[.25,.5,1,2];function $i(e){let t=e.smoke.length-1,r=F("Play (space)",Fi,()=>{Tr(e)});r.id="play";let i=x("input",{type:"range",min:0,max:Math.max(t,1),step:1,id:"scrub","aria-label":"Frame"});i.disabled=t<1;let s=x("output",{id:"frame"}),n=x("button",{type:"button",id:"speed",title:"Speed"});n.addEventListener("click",()=>{let c=(Er.indexOf(e.speed)+1)%Er.length;e.speed=Er[c],e.changed()});let a=!1;i.addEventListener("input",async()=>{if(!a){for(a=!0,e.pause();e.stage.at!==Number(i.value);)await e.goTo(Number(i.value));a=!1}});let l=()=>{let c=Math.max(e.stage.at,0);a||(i.value=String(c)),i.style.setProperty("--part",`${100*c/Math.max(t,1)}%`),s.textContent=String(e.smoke.number(c)),n.textContent=`${e.speed}×`,r.querySelector("path").setAttribute("d",e.isPlaying?an:Fi),r.classList.toggle("playing",e.isPlaying)};return e.addEventListener("change",l),e.addEventListener("frame",l),l(),x("div",{id:"transport",role:"group","aria-label":"Play"},F("From the beginning (R)",on,()=>{e.restart()}),r,i,s,n)}async function Tr(e){e.isPlaying?e.pause():await e.play()}var ln="Space plays · ← → frames · arrows with Shift turn · + − zoom · 1–4 brushes · N next style · B beside plain smoke · L alive · F frame · P picture · C link · H settings";function Oi(e){let t={" ":()=>{Tr(e)},r:()=>{e.restart()},f:()=>e.reframe(),b:()=>vr(e),l:()=>kr(e),p:()=>{xr(e)},c:()=>{Sr(e)},h:yr,n:()=>{cn(e)},"?":()=>z(ln),1:()=>Ue(e,"orbit"),2:()=>Ue(e,"erase"),3:()=>Ue(e,"more"),4:()=>Ue(e,"less"),"+":()=>e.look(r=>Ce(r,.9,0,1/0)),"-":()=>e.look(r=>Ce(r,1.1,0,1/0)),ArrowLeft:r=>Pt(e,r,-1,0),ArrowRight:r=>Pt(e,r,1,0),ArrowUp:r=>Pt(e,r,0,1),ArrowDown:r=>Pt(e,r,0,-1)};document.addEventListener("keydown",r=>{let i=r.target instanceof HTMLInputElement||r.target instanceof HTMLSelectElement;if(r.ctrlKey||r.metaKey||r.altKey||i)return;let s=t[r.key.length===1?r.key.toLowerCase():r.key];s!==void 0&&(r.preventDefault(),s(r))})}function Pt(e,t,r,i){t.shiftKey||i!==0?e.look(s=>zt(s,4*r,4*i)):(e.pause(),e.goTo(e.stage.at+r))}async function cn(e){let{rules:t}=e.show,r=t.findIndex(i=>i.name===e.names[0]);await e.use(t[(r+1)%t.length].name,0)}var hn=[["Paint",[{name:"strength",label:"Colour",low:0,high:1,step:.01,hint:"From white smoke to the colours of the style"},{name:"densityStrength",label:"Density change",low:0,high:1,step:.01,hint:"How much the style thins and thickens the smoke"},{name:"density",label:"Opacity",low:.02,high:20,step:.01,log:!0,unit:"×",hint:"Extinction γ, as a multiple of the style's own"},{name:"steps",label:"Steps a frame",low:0,high:64,step:1,hint:"How long the rule works between two frames; 0 is as in its training"},{name:"patternSpeed",label:"Pattern speed",low:0,high:2,step:.05,unit:"×",hint:"How fast the smoke carries the pattern from frame to frame: 0 stands, 1 goes along, 2 runs ahead"},{name:"detail",label:"Detail",low:1,high:3,step:1,unit:"×",hint:"Parts of a cell that are drawn, as by --refine"},{name:"half",label:"16-bit steps",low:0,high:1,step:1,hint:"Quicker, and a little rounder"},{name:"seed",label:"Seed",low:0,high:99,step:1,hint:"Another seed, another painting of the same style"}]],["Light",[{name:"light",label:"Light",low:0,high:3,step:.05,hint:"0: the smoke glows by itself"},{name:"lightAzimuth",label:"Around",low:-180,high:180,step:1,unit:"°",hint:"Where the light stands"},{name:"lightElevation",label:"Above",low:-90,high:90,step:1,unit:"°",hint:"How high it stands"},{name:"ambient",label:"Shadows",low:0,high:1,step:.01,hint:"How bright shadows are"},{name:"exposure",label:"Exposure",low:-3,high:3,step:.05,unit:" EV",hint:"Brightness of the picture"}]],["Guide",[{name:"guide",label:"Pull",low:0,high:1,step:.01,hint:"How much the pattern follows this direction instead of the smoke's motion"},{name:"guideAzimuth",label:"Around",low:-180,high:180,step:1,unit:"°",hint:"Direction of the pull"},{name:"guideElevation",label:"Up",low:-90,high:90,step:1,unit:"°",hint:"Direction of the pull"}]],["Brush and mix",[{name:"mix",label:"Second style",low:0,high:1,step:.01,hint:"How much of the second style is seen"},{name:"brush",label:"Brush",low:1,high:24,step:.5,unit:" cells",hint:"Radius of the brushes"}]]];function Di(e){let t=x("aside",{id:"panel","aria-label":"Settings"}),r=[];for(let[s,n]of hn){let a=x("details",{open:s!=="Guide"},x("summary",{},s));for(let l of n)l.name==="half"&&!e.gpu.hasHalf||a.append(un(e,l,r));t.append(a)}let i=()=>r.forEach(s=>s());return e.addEventListener("change",i),i(),t}function un(e,t,r){let{name:i,label:s,low:n,high:a,step:l,log:c=!1,unit:h="",hint:d}=t,m=x("input",{type:"range",min:c?Math.log(n):n,max:c?Math.log(a):a,step:c?"any":l,"aria-label":s,id:`set-${i}`}),u=x("output",{});m.addEventListener("input",()=>{let b=Number(m.value);e.set(i,c?Number(Math.exp(b).toPrecision(3)):b)});let p=x("label",{class:"slider",title:d,ondblclick:()=>{e.set(i,e.show.settings[i]??e.defaults[i])}},x("span",{},s),u,m);return r.push(()=>{let b=dn(e,i),S=c?Math.log(b):b;Number(m.value)!==S&&(m.value=String(S));let P=Number(m.min),A=(S-P)/(Number(m.max)-P);m.style.setProperty("--part",`${100*Math.min(Math.max(A,0),1)}%`),u.textContent=fn(e,i,b,h),p.classList.toggle("changed",!e.isDefault(i))}),p}function dn(e,t){let[r]=e.stage.layers;return t==="patternSpeed"&&r!==void 0?e.stage.patternSpeed(r):e.stage.settings[t]}function fn(e,t,r,i){if(t==="steps"&&r===0)return`${e.stage.layers[0]?.rule.steps??""} as trained`;let s=e.stage.settings[t]<0&&t==="patternSpeed"?" as trained":"";return`${Number(r.toPrecision(3))}${i}${s}`}async function ji(){let e;try{e=await(await fetch("show.json",{cache:"no-cache"})).json()}catch{throw new _("show.json is not there or damaged: this page has nothing to show.")}if(!(Array.isArray(e.rules)&&e.rules.length>0&&e.rules.every(({name:r,model:i})=>Hi(i)&&typeof r=="string")&&Hi(e.smoke)))throw new _("show.json is damaged: this page has nothing to show.");return e}function Hi(e){return typeof e=="string"&&/^[\w.-]+(\/[\w.-]+)*$/.test(e)&&!e.includes("..")}async function Ze(e){let t=await fetch(e,{cache:"no-cache"});if(!t.ok)throw new _(`${e}: the server says ${t.status}`);return t.arrayBuffer()}var mn=2e3,Ki=.8,qi=300,_r=64;function Yi(e){let t=x("section",{id:"curves","aria-label":"Training"});document.body.append(t);let r="",i=async()=>{try{let s=JSON.parse(new TextDecoder().decode(await Ze("run.json")));pn(t,s),s.model!==r&&(r=s.model,await e.learned(await Ze(e.show.rules[0].model)))}catch{}setTimeout(()=>{i()},mn)};i()}function pn(e,{iteration:t,iterations:r,curves:i}){let s=r>0?` of ${r}`:"",n=Object.entries(i).filter(([,a])=>a.length>1).map(([a,l])=>{let c=l[l.length-1][1],h=x("figcaption",{},a,x("output",{},String(Number(c.toPrecision(3)))));return x("figure",{},h,gn(l))});e.replaceChildren(x("h2",{},`Iteration ${t}${s}`),...n)}function gn(e){let t=e.filter(([,f])=>Number.isFinite(f)),r=t.every(([,f])=>f>0),i=t.map(([,f])=>r?Math.log(f):f),s=Math.min(...i),n=Math.max(...i)-s||1,a=t[0]?.[0]??0,l=(t[t.length-1]?.[0]??1)-a||1,c=f=>f.map((p,b)=>{let S=qi*(t[b][0]-a)/l;return`${b===0?"M":"L"}${S.toFixed(1)} ${(_r-_r*(p-s)/n).toFixed(1)}`}).join(""),h=i[0]??0,d=i.map(f=>h=Ki*h+(1-Ki)*f),m="http://www.w3.org/2000/svg",u=document.createElementNS(m,"svg");u.setAttribute("viewBox",`-2 -2 ${qi+4} ${_r+4}`);for(let[f,p]of[["raw",i],["mean",d]]){let b=document.createElementNS(m,"path");b.setAttribute("d",c(p)),b.setAttribute("class",f),u.append(b)}return u}var bn=500;function Xi(e){let t=x("nav",{id:"styles","aria-label":"Styles"}),r=new Map,i=async(c,h)=>{try{let d=h&&e.names[1]===c;await e.use(d?"":c,h?1:0)}catch(d){z(C(d))}},s=0,n=!1,a=()=>{for(let c of e.show.rules){if(r.has(c.name))continue;let h=x("button",{type:"button",title:`${c.title||c.name}. Right click, or hold: mix it with the one that paints`,onclick:d=>{n||i(c.name,d.shiftKey),n=!1},onpointerdown:d=>{n=!1,d.pointerType==="touch"&&(s=window.setTimeout(()=>{n=!0,i(c.name,!0)},bn))},onpointerup:()=>clearTimeout(s),onpointercancel:()=>clearTimeout(s),oncontextmenu:d=>{d.preventDefault(),n||i(c.name,!0),clearTimeout(s)}});c.thumbnail&&h.append(x("img",{src:c.thumbnail,alt:"",draggable:"false"})),h.append(x("span",{},c.name.replaceAll("_"," "))),r.set(c.name,h),c.model===""?t.prepend(h):t.append(h)}},l=()=>{a();for(let[c,h]of r)h.classList.toggle("first",e.names[0]===c),h.classList.toggle("second",e.names[1]===c),h.setAttribute("aria-pressed",String(e.names.includes(c)))};return e.addEventListener("rules",l),l(),t}var wn=4,yn=64*2**20,et={channels:64,hidden:1024,units:256,dilation:64,steps:4096},Qi={position:3,density:1,velocity:3},vn=["first","second","third","output"];function Mt(e,t){try{return kn(e,t)}catch(r){throw r instanceof _?r:new _(`${t}: damaged model (${r.message})`)}}function kn(e,t){let r=(T,U)=>L(T,`${t}: ${U}`);r(e.byteLength>=8,"not a model of vnca"),r(e.byteLength<=yn,"larger than any model of vnca");let i=Number(new DataView(e).getBigUint64(0,!0));r(i<=e.byteLength-8,"not a model of vnca");let s=Ji(new TextDecoder().decode(new Uint8Array(e,8,i)),t),n=s?.__metadata__?.vnca;r(typeof n=="string","not a model of vnca");let a=Ji(n,t);r(Number.isInteger(a.format_version)&&a.format_version>=1,"damaged model"),r(a.format_version<=wn,`its format, ${a.format_version}, is newer than this page`);let l=a.rule,c=T=>xn(e,8+i,s[T],`${t}: ${T}`),h=(T,U,G,de)=>{let rt=typeof T=="number"&&T>=U&&T<=G;return r(rt,`damaged model (${de} is not a number from ${U} to ${G})`),T},d=h(l.channels,4,et.channels,"channels"),m=h(l.hidden,1,et.hidden,"hidden"),u=a.conditioning??Object.entries(Qi).map(([T,U])=>[T,U]);r(Array.isArray(u),"damaged model");let f={},p=0;for(let[T,U]of u){let G=typeof T=="string"&&Qi[T]===U;r(G,`the rule is conditioned on ${String(T)}, which this page does not have`),l[`${T}_prior`]!==!1&&(f[T]=p),p+=U}let b=l.transport??!1;r(typeof b=="boolean","damaged model (transport is not true or false)");let S=tt(c("hidden"),m,5*d+p,`${t}: hidden`),P=tt(c("bias"),m,1,`${t}: bias`),A=tt(c("output"),d,m,`${t}: output`),{density:B,velocity:M,gamma:$}=a.scales;for(let T of[B,M,$])h(T,1e-30,1e30,"scale");return{name:t,title:String(a.training?.title??a.training?.style??""),channels:d,hidden:S,bias:P,output:A,decoder:Sn(s,c,d,t),probability:h(l.update_probability,1e-9,1,"update_probability"),steps:h(l.steps_per_frame,1,et.steps,"steps_per_frame"),transport:b,dilation:h(l.dilation??l.reach??1,0,et.dilation,"dilation"),wholeBox:l.domain==="box",sobel:h(l.sobel_divisor,1e-9,1e9,"sobel_divisor"),laplacian:h(l.laplacian_divisor,1e-9,1e9,"laplacian_divisor"),columns:f,width:p,density:B,speed:M,gamma:$,place:En(a.place,t)}}function Ji(e,t){try{return JSON.parse(e)}catch{throw new _(`${t}: not a model of vnca`)}}function xn(e,t,r,i){L(r!==void 0,`${i} is missing`),L(r.dtype==="F32",`${i}: expected F32, got ${String(r.dtype)}`);let[s,n=1]=r.shape,[a,l]=r.data_offsets,c=l-a===4*s*n&&a>=0&&t+l<=e.byteLength;L(c&&r.shape.length<=2,`${i}: its place in the file cannot be`);let h=new Float32Array(e.slice(t+a,t+l));return L(h.every(Number.isFinite),`${i}: not all finite`),{values:h,rows:s,columns:n}}function tt(e,t,r,i){let s=e.rows===t&&e.columns===r;return L(s,`${i}: expected ${t} × ${r}, got ${e.rows} × ${e.columns}`),e}function Sn(e,t,r,i){if(e["decoder.first"]===void 0)return[];let n=t("decoder.first").rows;return L(n>=1&&n<=et.units,`${i}: a decoder of ${n} units`),vn.map((a,l)=>{let c=a==="output"?4:n,h=`${i}: decoder.${a}`;return{weights:tt(t(`decoder.${a}`),c,l===0?r:n,h),bias:tt(t(`decoder.${a}_bias`),c,1,`${h}_bias`)}})}function En(e,t){if(e==null)return null;let r=e.lattice_to_world,[i,s]=e.box,n=[...r.flat(),...i,...s],a=n.length===22&&n.every(l=>Number.isFinite(l)&&Math.abs(l)<1e30);return L(a&&i.every((l,c)=>l<s[c]),`${t}: its place cannot be`),{toWorld:r,lower:i,upper:s}}var Tn="vncasmk1",_n=65536,Pn=2**24,Mn=1e5,An=2**20,Un=64*2**20,At=class e{constructor(t,r,i,s,n,a,l,c,h,d){this.url=t;this.name=r;this.fps=i;this.lower=s;this.upper=n;this.toWorld=a;this.density=l;this.speed=c;this.stored=h;this.begin=d}url;name;fps;lower;upper;toWorld;density;speed;stored;begin;frames=new Map;whole=null;get length(){return this.stored.length}number(t){return this.stored[t].number}static async open(t){let r=t.split("/").pop()??t,{bytes:i,isWhole:s}=await Pr(t,0,_n);L(i.length>=12,`${r}: not a sequence of vnca`);let n=String.fromCharCode(...i.subarray(0,8));L(n===Tn,`${r}: not a sequence of vnca`);let a=new DataView(i.buffer,i.byteOffset).getUint32(8,!0);L(a<=Pn,`${r}: its header is damaged`),i.length<12+a&&!s&&({bytes:i,isWhole:s}=await Pr(t,0,12+a)),L(i.length>=12+a,`${r}: it ends within its header`);let l;try{let c=new TextDecoder().decode(i.subarray(12,12+a));l=e.described(t,r,JSON.parse(c),12+a)}catch(c){throw c instanceof _?c:new _(`${r}: its header is damaged (${C(c)})`)}return s&&(l.whole=i),l}static described(t,r,i,s){let n=(b,S)=>L(b,`${r}: its header is damaged (${S})`),[a,l]=i.box,c=[...a,...l].every(Number.isInteger)&&a.length===3;n(c&&a.every((b,S)=>b<l[S]),"box");let{density:h,speed:d,fps:m}=i;n(h>0&&h<1e30&&d>=0&&d<1e30,"scales"),n(m>0&&m<=1e3,"fps");let u=i.lattice_to_world;n(u.flat().length===16&&u.flat().every(Number.isFinite),"lattice_to_world");let f=i.frames;n(Array.isArray(f)&&f.length>=1&&f.length<=Mn,"frames");for(let{number:b,offset:S,length:P,bricks:A}of f){let B=[S,P,A].every(M=>Number.isInteger(M)&&M>=0);n(B&&Number.isInteger(b)&&A<=An,"frames")}let p=String(i.name??r).slice(0,100);return new e(t,p,m,a,l,u,h,d,f,s)}frame(t){let r=this.frames.get(t);return r===void 0&&(r=this.read(this.stored[t]),this.frames.set(t,r),r.catch(()=>this.frames.delete(t)),this.forget()),r}forget(){let t=0;for(let r of[...this.frames.keys()].reverse())t+=this.stored[r].bricks*2048,t>Un&&this.frames.delete(r)}async read(t){let{number:r,offset:i,length:s,bricks:n}=t,a=`${this.name}, frame ${r}`,l;if(this.whole===null){let{bytes:p,isWhole:b}=await Pr(this.url,this.begin+i,s);b&&(this.whole=p),l=b?p.subarray(this.begin+i,this.begin+i+s):p}else l=this.whole.subarray(this.begin+i,this.begin+i+s);L(l.length===s,`${a}: the file ends before it`);let c=n*(6+512*(this.speed>0?4:1)),h=await Ln(l,c,a),d=this.lower.map(p=>Math.floor(p/8)),m=this.upper.map(p=>Math.floor((p-1)/8)),u=new DataView(h.buffer),f=new Int32Array(3*n);for(let p=0;p<f.length;p++)f[p]=u.getUint16(2*p,!0)+d[p%3],L(f[p]<=m[p%3],`${a}: a brick lies outside the box`);return{number:r,count:n,bricks:f,planes:h.slice(6*n)}}};async function Pr(e,t,r){let i=`bytes=${t}-${t+Math.max(r,1)-1}`,s=await fetch(e,{headers:{Range:i}});if(s.status!==206&&s.status!==200)throw new _(`${e.split("/").pop()}: the server says ${s.status}`);return{bytes:new Uint8Array(await s.arrayBuffer()),isWhole:s.status===200}}async function Ln(e,t,r){let i=new Uint8Array(t),n=new Blob([e]).stream().pipeThrough(new DecompressionStream("deflate")).getReader(),a=0;try{for(;;){let{done:l,value:c}=await n.read();if(l)break;L(a+c.length<=t,`${r}: more than it says`),i.set(c,a),a+=c.length}}catch(l){throw n.cancel().catch(()=>{}),l instanceof _?l:new _(`${r}: damaged`)}return L(a===t,`${r}: less than it says`),i}var Cn=15,zn=9,Zi=.3,Bn=250,Nn=1.22,In=.07,Wn=["guide","guideAzimuth","guideElevation"],Ut=class e extends EventTarget{constructor(r,i,s){super();this.canvas=r;this.show=i;this.smoke=s}canvas;show;smoke;gpu;stage;isPlaying=!1;isAlive=!0;speed=1;tool="orbit";names=["",""];fineness=1;took=0;context;isDirty=!0;isSettled=!1;lastChange=0;due=0;isBusy=!1;isClosed=!1;rules=new Map;static async open(r,i){let s=new e(r,i,await At.open(i.smoke));return await s.start(),new ResizeObserver(()=>s.resized()).observe(r),requestAnimationFrame(s.tick),s}async start(){this.gpu=await at.open();let r=navigator.gpu.getPreferredCanvasFormat(),i=this.canvas.getContext("webgpu");if(i===null)throw new _("This browser gives WebGPU no canvas.");this.context=i,i.configure({device:this.gpu.device,format:r,alphaMode:"opaque"}),this.gpu.device.addEventListener("uncapturederror",s=>{z(`The GPU complains: ${C(s.error.message)}`)}),this.stage=await ut.create(this.gpu,this.smoke,r),this.reframe(),this.gpu.lost.then(s=>this.recover(s))}async recover(r){if(this.isClosed)return;let{settings:i,camera:s,at:n}=this.stage;z("The GPU was lost; the page begins again.");try{await this.start(),Object.assign(this.stage.settings,i),this.stage.camera=s,await this.use(this.names[0],0),this.names[1]&&await this.use(this.names[1],1),await this.goTo(Math.max(n,0)),this.dispatchEvent(new Event("recovered"))}catch(a){nt("The GPU is gone",`${C(a)} ${r.message}`)}}close(){this.isClosed=!0,this.gpu.device.destroy()}get aspect(){return(this.canvas.clientWidth||1)/(this.canvas.clientHeight||1)}resized(){this.changed()}changed(){this.isDirty=!0,this.isSettled=!1,this.lastChange=performance.now(),this.dispatchEvent(new Event("change"))}async rule(r){let i=this.rules.get(r);if(i===void 0){let s=this.show.rules.find(n=>n.name===r);if(s===void 0)throw new _(`There is no rule '${r}' here.`);i=Mt(await Ze(s.model),r),this.rules.set(r,i)}return i}async use(r,i){let s=r===""?null:await this.rule(r);await this.exclusively(()=>this.stage.use(s,i)),this.names[i]=r,i===1&&r!==""&&this.stage.settings.mix===0&&this.set("mix",.5),this.changed(),this.dispatchEvent(new Event("rules"))}async add(r){let i=Mt(await r.arrayBuffer(),r.name);this.rules.set(r.name,i),this.show.rules.unshift({name:r.name,title:i.title,model:""}),await this.use(r.name,0)}async learned(r){let i=this.names[0],s=Mt(r,i);this.rules.set(i,s);let[n]=this.stage.layers;n?.learn(s)||await this.use(i,0),this.changed()}set(r,i){this.stage.settings[r]=i,Wn.includes(r)&&this.stage.conditionAgain(),r==="half"&&this.names.forEach((s,n)=>{this.use(s,n)}),this.stage.lookAgain(),this.changed()}get defaults(){return me}isDefault(r){return this.stage.settings[r]===(this.show.settings[r]??me[r])}async exclusively(r){for(;this.isBusy;)await new Promise(i=>setTimeout(i,5));this.isBusy=!0;try{await r()}finally{this.isBusy=!1}}async goTo(r){let i=Math.min(Math.max(r,0),this.smoke.length-1);await this.exclusively(()=>this.stage.show(i)),this.changed()}async restart(){await this.exclusively(()=>this.stage.restart()),this.changed()}async play(){this.stage.at===this.smoke.length-1&&await this.restart(),this.isPlaying=!0,this.due=performance.now(),this.changed()}pause(){this.isPlaying=!1,this.changed()}look(r){r(this.stage.camera),this.changed()}reframe(){let r=this.stage.framed(this.aspect);r.distance*=Nn,Bt(r,0,In),this.stage.camera=r,this.changed()}move(r,i){this.look(s=>Bt(s,r,i))}async touch(r,i){let{tool:s}=this;if(s!=="orbit"){if(s!=="erase"&&this.stage.layers.length<2){z("Choose a second style to brush it on.");return}await this.exclusively(()=>this.stage.touch(s,[r-.5,.5-i],this.aspect)),this.changed()}}tick=async r=>{if(!this.isClosed&&(requestAnimationFrame(i=>{this.tick(i)}),!(this.isBusy||document.hidden||this.stage.layers.length===0))){this.isBusy=!0;try{await this.frame(r)}catch(i){this.isPlaying=!1,z(C(i))}finally{this.isBusy=!1}}};async frame(r){let i=performance.now();this.isPlaying&&r>=this.due?await this.advance(r):this.isAlive&&!this.isPlaying&&!this.isSettled&&this.stage.at>=0&&(this.stage.step(1),this.isDirty=!0);let s=r-this.lastChange>Bn&&!this.isPlaying;!this.isDirty&&(this.isSettled||!s)||(this.isDirty=!1,this.draw(s?1:this.fineness),this.isSettled=s&&!this.isAlive,await this.gpu.device.queue.onSubmittedWorkDone(),s||this.adapt(performance.now()-i))}async advance(r){let i=this.stage.at+1;if(i>=this.smoke.length){this.isPlaying=!1,this.dispatchEvent(new Event("ended")),this.changed();return}let s=r-this.due,n=1e3/(this.smoke.fps*this.speed);this.due=s>n?r+n:this.due+n,await this.stage.show(i),this.isDirty=!0,this.dispatchEvent(new Event("frame"))}draw(r){let i=window.devicePixelRatio||1,s=this.gpu.device.limits.maxTextureDimension2D,n=Math.min(Math.max(Math.round(this.canvas.clientWidth*i),1),s),a=Math.min(Math.max(Math.round(this.canvas.clientHeight*i),1),s);(this.canvas.width!==n||this.canvas.height!==a)&&([this.canvas.width,this.canvas.height]=[n,a]);let l=this.stage.take(Math.max(Math.round(n*r),16),Math.max(Math.round(a*r),16));this.stage.present(l,this.context.getCurrentTexture().createView(),n,a)}adapt(r){this.took=this.took===0?r:.8*this.took+.2*r,this.took>Cn?this.fineness>Zi?this.fineness=Math.max(this.fineness*.92,Zi):this.stage.samples=1:this.took<zn&&(this.stage.samples===1?this.stage.samples=0:this.fineness=Math.min(this.fineness*1.04,1))}};var Rn=document.getElementById("canvas");async function Vn(){let e=await ji();document.title=`${e.title} · vnca`;let t=await Ut.open(Rn,e);Object.assign(t.stage.settings,Gn(e.settings,t)),Object.assign(globalThis,{viewer:t}),await Ot(t,location.hash),window.addEventListener("hashchange",()=>{Ot(t,location.hash)}),Fn(t),document.body.classList.add("ready"),e.run?Yi(t):location.hash||await t.play()}function Gn(e,t){return Object.fromEntries(Object.entries(e).filter(([r])=>r in t.stage.settings))}function Fn(e){let t=x("span",{id:"painted"}),r=()=>{let[i,s]=e.names.map(n=>n.replaceAll("_"," "));t.textContent=s?`${i} and ${s}`:i};e.addEventListener("rules",r),r(),window.innerWidth<720&&document.body.classList.add("bare"),document.body.append(x("header",{},x("h1",{},e.smoke.name),t),Gi(e),Di(e),x("footer",{},Xi(e),$i(e))),Ir(e),Oi(e),document.addEventListener("dragover",i=>i.preventDefault()),document.addEventListener("drop",i=>{i.preventDefault();let s=i.dataTransfer?.files[0];s&&e.add(s).catch(n=>z(C(n)))})}Vn().catch(e=>{let t=C(e),r=/WebGPU/.test(t);nt(r?"No WebGPU here":"This cannot be shown",r?`${t} ${Rr}`:t)});
