/* vnca, Apache-2.0; sources 89b3a7d315c50265ff62de209a1b21414d6b8d939c94c58fa26c9741e05b9289 */
function k(t,e={},...r){let i=document.createElement(t);for(let[s,n]of Object.entries(e))typeof n=="function"?i.addEventListener(s.slice(2),n):typeof n=="boolean"?i.toggleAttribute(s,n):i.setAttribute(s,String(n));return i.append(...r),i}function Ws(t){let e="http://www.w3.org/2000/svg",r=document.createElementNS(e,"svg");r.setAttribute("viewBox","0 0 24 24"),r.setAttribute("aria-hidden","true");let i=document.createElementNS(e,"path");return i.setAttribute("d",t),r.append(i),r}function F(t,e,r){let i=k("button",{type:"button",title:t,"aria-label":t,onclick:r});return i.append(Ws(e)),i}function ii(t,e){let r=URL.createObjectURL(t);k("a",{href:r,download:e}).click(),setTimeout(()=>URL.revokeObjectURL(r),6e4)}function si(t,e){return t.map(r=>[0,1,2,3].map(i=>r.reduce((s,n,a)=>s+n*e[a][i],0)))}function gt(t,e){return[0,1,2].map(r=>pt(t[r],e)+t[r][3])}function ni(t,e){return[0,1,2].map(r=>pt(t[r],e))}function pt(t,e){return t[0]*e[0]+t[1]*e[1]+t[2]*e[2]}function ne(t){let[e,r,i]=t.map(u=>u.slice(0,3)),s=(u,h)=>[u[1]*h[2]-u[2]*h[1],u[2]*h[0]-u[0]*h[2],u[0]*h[1]-u[1]*h[0]],n=[s(r,i),s(i,e),s(e,r)],a=pt(e,n[0]),l=[0,1,2].map(u=>n.map(h=>h[u]/a)),c=[t[0][3],t[1][3],t[2][3]];return[...l.map(u=>[...u,-pt(u,c)]),[0,0,0,1]]}function wt(t){if(!Array.isArray(t)||t.length!==4)return!1;let e=i=>typeof i=="number"&&Math.abs(i)<1e30;return t.every(i=>Array.isArray(i)&&i.length===4&&i.every(e))?[0,0,0,1].every((i,s)=>t[3][s]===i)&&ne(t).flat().every(i=>Math.abs(i)<1e30):!1}function bt(t){if(!Array.isArray(t)||t.length!==2)return!1;let e=n=>Number.isInteger(n)&&Math.abs(n)<2**30,[r,i]=t;return t.every(n=>Array.isArray(n)&&n.length===3&&n.every(e))&&r.every((n,a)=>n<i[a])}function I(t,e,r=1){return t.map((i,s)=>i+r*e[s])}function C(t,e){return t.map(r=>r*e)}function ai(t,e){return t.reduce((r,i,s)=>r+i*e[s],0)}var rr=Math.PI/180,Vs=.04;function H(t,e){let[r,i]=[t*rr,e*rr],s=[Math.cos(r),Math.sin(r),0],n=[-Math.sin(r),Math.cos(r),0],a=[0,0,1],l=I(C(n,Math.sin(i)),a,Math.cos(i)),c=I(C(n,Math.cos(i)),a,-Math.sin(i));return[s,l,c]}function Z(t){return Math.tan(t*rr/2)}function yt(t){let[,,e]=H(t.azimuth,t.elevation);return I(t.target,e,-t.distance)}function li(t,e,r,i,s,n){let a=H(r,i),l=C(I(t,e),.5),c=Array.from({length:8},(E,v)=>I([0,1,2].map(T=>(v>>T&1?e:t)[T]),l,-1)),[u,h,f]=a.map(E=>c.map(v=>ai(v,E))),d=(1-2*Vs)*Z(n),[m,p]=oi(u,f,d*s),[g,S]=oi(h,f,d);return{target:I(I(l,a[0],m),a[1],g),azimuth:r,elevation:i,distance:Math.max(p,S),fieldOfView:n}}function oi(t,e,r){let i=Math.max(...t.map((n,a)=>n-r*e[a])),s=Math.max(...t.map((n,a)=>-n-r*e[a]));return[(i-s)/2,(i+s)/(2*r)]}var ci=.35,ui=89,Gs=12;function ir(t,e,r){t.azimuth=((t.azimuth+e)%360+360)%360,t.elevation=Math.min(Math.max(t.elevation+r,-ui),ui)}function sr(t,e,r){let[i,s]=H(t.azimuth,t.elevation),n=2*t.distance*Z(t.fieldOfView);t.target=I(I(t.target,i,-e*n),s,-r*n)}function Ve(t,e,r,i){t.distance=Math.min(Math.max(t.distance*e,r),i)}function hi(t){let{canvas:e}=t,r=new Map,i=t.stage.camera.distance,s=i/20,n=i*10,a=!1,l=async d=>{if(a)return;a=!0;let{left:m,top:p,width:g,height:S}=e.getBoundingClientRect();await t.touch((d.clientX-m)/g,(d.clientY-p)/S),a=!1},c=d=>{let{left:m,width:p}=e.getBoundingClientRect();return(d.clientX-m)/p},u=!1,h=d=>t.tool!=="orbit"&&r.size===1&&!d.shiftKey&&!(d.buttons&6);e.addEventListener("pointerdown",d=>{e.setPointerCapture(d.pointerId),r.set(d.pointerId,d);let{wipe:m}=t.stage.settings;u=m<1&&Math.abs(c(d)-m)*e.clientWidth<Gs,!u&&h(d)&&l(d)}),e.addEventListener("pointermove",d=>{let m=r.get(d.pointerId);if(m===void 0)return;let p=d.clientX-m.clientX,g=d.clientY-m.clientY,S=[...r.values()].find(E=>E.pointerId!==d.pointerId);if(r.set(d.pointerId,d),u)t.set("wipe",Math.min(Math.max(c(d),.02),.98));else if(h(d))l(d);else if(S!==void 0){let E=v=>Math.hypot(v.clientX-S.clientX,v.clientY-S.clientY)||1;t.look(v=>Ve(v,E(m)/E(d),s,n)),t.move(p/2/e.clientHeight,-g/2/e.clientHeight)}else d.shiftKey||d.buttons&6?t.move(p/e.clientHeight,-g/e.clientHeight):t.look(E=>ir(E,-ci*p,ci*g))});let f=d=>{r.delete(d.pointerId),u=!1};e.addEventListener("pointerup",f),e.addEventListener("pointercancel",f),e.addEventListener("contextmenu",d=>d.preventDefault()),e.addEventListener("wheel",d=>{d.preventDefault();let m=d.deltaMode===WheelEvent.DOM_DELTA_LINE?30:1;t.look(p=>Ve(p,Math.exp(m*d.deltaY/900),s,n))},{passive:!1}),e.addEventListener("dblclick",()=>t.reframe())}var Fs=[["Turn","drag","Shift ← → · ↑ ↓"],["Pan","Shift or right button, drag · two fingers",""],["Zoom","wheel · pinch","+ −"],["Frame the smoke","double click","F"],["Play · frame by frame · from the start","","Space · ← → · R"],["Another style","click its picture","N"],["Mix a second style in","right click, or hold, its picture",""],["Turn · erase · second style on · off","drag over the smoke","1 · 2 · 3 · 4"],["Beside the plain smoke","drag the line","B"],["Go on while nothing plays","","L"],["Save a picture · copy a link","","P · C"],["Settings","double click resets a slider","H"],["A model of your own","drop its file onto the page",""]];function di(){let t=Fs.map(([i,s,n])=>k("tr",{},k("th",{scope:"row"},i),k("td",{},s),k("td",{class:"keys"},n))),e=k("button",{type:"button",class:"close",autofocus:!0},"Close"),r=k("dialog",{id:"help","aria-label":"What can be done"},k("h2",{},"What can be done"),k("table",{},...t),e);return e.addEventListener("click",()=>r.close()),r.addEventListener("click",i=>{i.target===r&&r.close()}),r}function vt(){let t=document.getElementById("help");t.open?t.close():t.showModal()}var he={seed:0,steps:0,warmup:64,patternSpeed:-1,strength:1,densityStrength:1,density:1,exposure:0,light:2,lightAzimuth:-55,lightElevation:40,ambient:.2,guide:0,guideAzimuth:0,guideElevation:90,mix:0,wipe:2,detail:1,brush:5,half:0};var fi=Object.keys(he),mi=["azimuth","elevation","distance"],Os={seed:[0,2**31],exposure:[-16,16],guide:[0,1],mix:[0,1],wipe:[0,2],brush:[.5,64],detail:[1,4],strength:[0,1],densityStrength:[0,1],steps:[0,256],warmup:[0,4096],patternSpeed:[-1,8],density:[.001,1e3],light:[0,20],ambient:[0,1],half:[0,1]};function ar(t,e){let[r,i]=Os[t]??[-1e6,1e6],s=t==="detail"?Math.round(e):e;return Math.min(Math.max(s,r),i)}function pi(t){let e=new URLSearchParams,{settings:r,camera:i,at:s}=t.stage;t.names[0]!==t.show.rules[0].name&&e.set("rule",t.names[0]),t.names[1]&&e.set("with",t.names[1]);for(let a of fi)t.isDefault(a)||e.set(a,nr(r[a]));for(let a of mi)e.set(a,nr(i[a]));e.set("target",i.target.map(nr).join(",")),s>0&&e.set("frame",String(s));let n=new URL(location.href);return n.hash=e.toString(),n.href}async function or(t,e){let r=new URLSearchParams(e.replace(/^#/,"")),i=u=>{let h=Number(r.get(u));return r.has(u)&&Number.isFinite(h)?h:null},{settings:s,camera:n}=t.stage;for(let u of fi){let h=i(u);h!==null&&(s[u]=ar(u,h))}for(let u of mi){let h=i(u);h!==null&&(u!=="distance"||h>0)&&(n[u]=h)}let a=(r.get("target")??"").split(",").map(Number);a.length===3&&a.every(Number.isFinite)&&(n.target=a);let l=u=>t.show.rules.some(h=>h.name===u)?u:null;await t.use(l(r.get("rule"))??t.show.rules[0].name,0);let c=l(r.get("with"));c!==null&&await t.use(c,1),await t.goTo(Math.round(i("frame")??0))}function nr(t){return String(Number(t.toPrecision(6)))}var P=class extends Error{};function R(t){let e=String(t instanceof Error?t.message:t).replace(/\s+/g," ").trim();return e.length>300?`${e.slice(0,300)}…`:e}function L(t,e){if(!t)throw new P(e)}var Ds=6e3,gi=0;function $(t){let e=document.getElementById("notice")??k("div",{id:"notice",role:"status"});e.textContent=R(t),e.classList.add("shown"),document.body.append(e),clearTimeout(gi),gi=window.setTimeout(()=>e.classList.remove("shown"),Ds)}function kt(t,e){document.getElementById("stopped")?.remove(),document.body.classList.add("stopped"),document.body.append(k("main",{id:"stopped"},k("h1",{},t),k("p",{id:"reason"},R(e))))}var wi="WebGPU is in current Chrome and Edge, in Safari 26 and in Firefox. On Linux Chrome may have to be started with --enable-unsafe-webgpu --enable-features=Vulkan.";var yr=(t,e,r)=>{if(!e.has(t))throw TypeError("Cannot "+r)},o=(t,e,r)=>(yr(t,e,"read from private field"),r?r.call(t):e.get(t)),w=(t,e,r)=>{if(e.has(t))throw TypeError("Cannot add the same private member more than once");e instanceof WeakSet?e.add(t):e.set(t,r)},_=(t,e,r,i)=>(yr(t,e,"write to private field"),i?i.call(t,r):e.set(t,r),r),b=(t,e,r)=>(yr(t,e,"access private method"),r),yi=class{constructor(t){this.value=t}},vr=class{constructor(t){this.value=t}},vi=t=>t<256?1:t<65536?2:t<1<<24?3:t<2**32?4:t<2**40?5:6,Hs=t=>{if(t<127)return 1;if(t<16383)return 2;if(t<(1<<21)-1)return 3;if(t<(1<<28)-1)return 4;if(t<2**35-1)return 5;if(t<2**42-1)return 6;throw new Error("EBML VINT size not supported "+t)},ke=(t,e,r)=>{let i=0;for(let s=e;s<r;s++){let n=Math.floor(s/8),a=t[n],l=7-(s&7),c=(a&1<<l)>>l;i<<=1,i|=c}return i},js=(t,e,r,i)=>{for(let s=e;s<r;s++){let n=Math.floor(s/8),a=t[n],l=7-(s&7);a&=~(1<<l),a|=(i&1<<r-s-1)>>r-s-1<<l,t[n]=a}};var Ct=class{},kr=class extends Ct{constructor(){super(...arguments),this.buffer=null}},ki=class extends Ct{constructor(t){if(super(),this.options=t,typeof t!="object")throw new TypeError("StreamTarget requires an options object to be passed to its constructor.");if(t.onData){if(typeof t.onData!="function")throw new TypeError("options.onData, when provided, must be a function.");if(t.onData.length<2)throw new TypeError("options.onData, when provided, must be a function that takes in at least two arguments (data and position). Ignoring the position argument, which specifies the byte offset at which the data is to be written, can lead to broken outputs.")}if(t.onHeader&&typeof t.onHeader!="function")throw new TypeError("options.onHeader, when provided, must be a function.");if(t.onCluster&&typeof t.onCluster!="function")throw new TypeError("options.onCluster, when provided, must be a function.");if(t.chunked!==void 0&&typeof t.chunked!="boolean")throw new TypeError("options.chunked, when provided, must be a boolean.");if(t.chunkSize!==void 0&&(!Number.isInteger(t.chunkSize)||t.chunkSize<1024))throw new TypeError("options.chunkSize, when provided, must be an integer and not smaller than 1024.")}},qs=class extends Ct{constructor(t,e){if(super(),this.stream=t,this.options=e,!(t instanceof FileSystemWritableFileStream))throw new TypeError("FileSystemWritableFileStreamTarget requires a FileSystemWritableFileStream instance.");if(e!==void 0&&typeof e!="object")throw new TypeError("FileSystemWritableFileStreamTarget's options, when provided, must be an object.");if(e&&e.chunkSize!==void 0&&(!Number.isInteger(e.chunkSize)||e.chunkSize<=0))throw new TypeError("options.chunkSize, when provided, must be a positive integer")}},le,A,lr,xi,cr,Si,ur,Ei,xt,hr,dr,_i,Ti=class{constructor(){w(this,lr),w(this,cr),w(this,ur),w(this,xt),w(this,dr),this.pos=0,w(this,le,new Uint8Array(8)),w(this,A,new DataView(o(this,le).buffer)),this.offsets=new WeakMap,this.dataOffsets=new WeakMap}seek(t){this.pos=t}writeEBMLVarInt(t,e=Hs(t)){let r=0;switch(e){case 1:o(this,A).setUint8(r++,128|t);break;case 2:o(this,A).setUint8(r++,64|t>>8),o(this,A).setUint8(r++,t);break;case 3:o(this,A).setUint8(r++,32|t>>16),o(this,A).setUint8(r++,t>>8),o(this,A).setUint8(r++,t);break;case 4:o(this,A).setUint8(r++,16|t>>24),o(this,A).setUint8(r++,t>>16),o(this,A).setUint8(r++,t>>8),o(this,A).setUint8(r++,t);break;case 5:o(this,A).setUint8(r++,8|t/2**32&7),o(this,A).setUint8(r++,t>>24),o(this,A).setUint8(r++,t>>16),o(this,A).setUint8(r++,t>>8),o(this,A).setUint8(r++,t);break;case 6:o(this,A).setUint8(r++,4|t/2**40&3),o(this,A).setUint8(r++,t/2**32|0),o(this,A).setUint8(r++,t>>24),o(this,A).setUint8(r++,t>>16),o(this,A).setUint8(r++,t>>8),o(this,A).setUint8(r++,t);break;default:throw new Error("Bad EBML VINT size "+e)}this.write(o(this,le).subarray(0,r))}writeEBML(t){if(t!==null)if(t instanceof Uint8Array)this.write(t);else if(Array.isArray(t))for(let e of t)this.writeEBML(e);else if(this.offsets.set(t,this.pos),b(this,xt,hr).call(this,t.id),Array.isArray(t.data)){let e=this.pos,r=t.size===-1?1:t.size??4;t.size===-1?b(this,lr,xi).call(this,255):this.seek(this.pos+r);let i=this.pos;if(this.dataOffsets.set(t,i),this.writeEBML(t.data),t.size!==-1){let s=this.pos-i,n=this.pos;this.seek(e),this.writeEBMLVarInt(s,r),this.seek(n)}}else if(typeof t.data=="number"){let e=t.size??vi(t.data);this.writeEBMLVarInt(e),b(this,xt,hr).call(this,t.data,e)}else typeof t.data=="string"?(this.writeEBMLVarInt(t.data.length),b(this,dr,_i).call(this,t.data)):t.data instanceof Uint8Array?(this.writeEBMLVarInt(t.data.byteLength,t.size),this.write(t.data)):t.data instanceof yi?(this.writeEBMLVarInt(4),b(this,cr,Si).call(this,t.data.value)):t.data instanceof vr&&(this.writeEBMLVarInt(8),b(this,ur,Ei).call(this,t.data.value))}};le=new WeakMap;A=new WeakMap;lr=new WeakSet;xi=function(t){o(this,A).setUint8(0,t),this.write(o(this,le).subarray(0,1))};cr=new WeakSet;Si=function(t){o(this,A).setFloat32(0,t,!1),this.write(o(this,le).subarray(0,4))};ur=new WeakSet;Ei=function(t){o(this,A).setFloat64(0,t,!1),this.write(o(this,le))};xt=new WeakSet;hr=function(t,e=vi(t)){let r=0;switch(e){case 6:o(this,A).setUint8(r++,t/2**40|0);case 5:o(this,A).setUint8(r++,t/2**32|0);case 4:o(this,A).setUint8(r++,t>>24);case 3:o(this,A).setUint8(r++,t>>16);case 2:o(this,A).setUint8(r++,t>>8);case 1:o(this,A).setUint8(r++,t);break;default:throw new Error("Bad UINT size "+e)}this.write(o(this,le).subarray(0,r))};dr=new WeakSet;_i=function(t){this.write(new Uint8Array(t.split("").map(e=>e.charCodeAt(0))))};var St,we,Ze,Et,fr,Ks=class extends Ti{constructor(t){super(),w(this,Et),w(this,St,void 0),w(this,we,new ArrayBuffer(2**16)),w(this,Ze,new Uint8Array(o(this,we))),_(this,St,t)}write(t){b(this,Et,fr).call(this,this.pos+t.byteLength),o(this,Ze).set(t,this.pos),this.pos+=t.byteLength}finalize(){b(this,Et,fr).call(this,this.pos),o(this,St).buffer=o(this,we).slice(0,this.pos)}};St=new WeakMap;we=new WeakMap;Ze=new WeakMap;Et=new WeakSet;fr=function(t){let e=o(this,we).byteLength;for(;e<t;)e*=2;if(e===o(this,we).byteLength)return;let r=new ArrayBuffer(e),i=new Uint8Array(r);i.set(o(this,Ze),0),_(this,we,r),_(this,Ze,i)};var xe,q,K,de,st=class extends Ti{constructor(t){super(),this.target=t,w(this,xe,!1),w(this,q,void 0),w(this,K,void 0),w(this,de,void 0)}write(t){if(!o(this,xe))return;let e=this.pos;if(e<o(this,K)){if(e+t.byteLength<=o(this,K))return;t=t.subarray(o(this,K)-e),e=0}let r=e+t.byteLength-o(this,K),i=o(this,q).byteLength;for(;i<r;)i*=2;if(i!==o(this,q).byteLength){let s=new Uint8Array(i);s.set(o(this,q),0),_(this,q,s)}o(this,q).set(t,e-o(this,K)),_(this,de,Math.max(o(this,de),e+t.byteLength))}startTrackingWrites(){_(this,xe,!0),_(this,q,new Uint8Array(2**10)),_(this,K,this.pos),_(this,de,this.pos)}getTrackedWrites(){if(!o(this,xe))throw new Error("Can't get tracked writes since nothing was tracked.");let e={data:o(this,q).subarray(0,o(this,de)-o(this,K)),start:o(this,K),end:o(this,de)};return _(this,q,void 0),_(this,xe,!1),e}};xe=new WeakMap;q=new WeakMap;K=new WeakMap;de=new WeakMap;var Ys=2**24,Xs=2,fe,Te,He,Ge,te,O,At,mr,xr,Mi,Sr,Ai,je,Pt,Er=class extends st{constructor(t,e){super(t),w(this,At),w(this,xr),w(this,Sr),w(this,je),w(this,fe,[]),w(this,Te,0),w(this,He,void 0),w(this,Ge,void 0),w(this,te,void 0),w(this,O,[]),_(this,He,e),_(this,Ge,t.options?.chunked??!1),_(this,te,t.options?.chunkSize??Ys)}write(t){super.write(t),o(this,fe).push({data:t.slice(),start:this.pos}),this.pos+=t.byteLength}flush(){if(o(this,fe).length===0)return;let t=[],e=[...o(this,fe)].sort((r,i)=>r.start-i.start);t.push({start:e[0].start,size:e[0].data.byteLength});for(let r=1;r<e.length;r++){let i=t[t.length-1],s=e[r];s.start<=i.start+i.size?i.size=Math.max(i.size,s.start+s.data.byteLength-i.start):t.push({start:s.start,size:s.data.byteLength})}for(let r of t){r.data=new Uint8Array(r.size);for(let i of o(this,fe))r.start<=i.start&&i.start<r.start+r.size&&r.data.set(i.data,i.start-r.start);if(o(this,Ge))b(this,At,mr).call(this,r.data,r.start),b(this,je,Pt).call(this);else{if(o(this,He)&&r.start<o(this,Te))throw new Error("Internal error: Monotonicity violation.");this.target.options.onData?.(r.data,r.start),_(this,Te,r.start+r.data.byteLength)}}o(this,fe).length=0}finalize(){o(this,Ge)&&b(this,je,Pt).call(this,!0)}};fe=new WeakMap;Te=new WeakMap;He=new WeakMap;Ge=new WeakMap;te=new WeakMap;O=new WeakMap;At=new WeakSet;mr=function(t,e){let r=o(this,O).findIndex(l=>l.start<=e&&e<l.start+o(this,te));r===-1&&(r=b(this,Sr,Ai).call(this,e));let i=o(this,O)[r],s=e-i.start,n=t.subarray(0,Math.min(o(this,te)-s,t.byteLength));i.data.set(n,s);let a={start:s,end:s+n.byteLength};if(b(this,xr,Mi).call(this,i,a),i.written[0].start===0&&i.written[0].end===o(this,te)&&(i.shouldFlush=!0),o(this,O).length>Xs){for(let l=0;l<o(this,O).length-1;l++)o(this,O)[l].shouldFlush=!0;b(this,je,Pt).call(this)}n.byteLength<t.byteLength&&b(this,At,mr).call(this,t.subarray(n.byteLength),e+n.byteLength)};xr=new WeakSet;Mi=function(t,e){let r=0,i=t.written.length-1,s=-1;for(;r<=i;){let n=Math.floor(r+(i-r+1)/2);t.written[n].start<=e.start?(r=n+1,s=n):i=n-1}for(t.written.splice(s+1,0,e),(s===-1||t.written[s].end<e.start)&&s++;s<t.written.length-1&&t.written[s].end>=t.written[s+1].start;)t.written[s].end=Math.max(t.written[s].end,t.written[s+1].end),t.written.splice(s+1,1)};Sr=new WeakSet;Ai=function(t){let r={start:Math.floor(t/o(this,te))*o(this,te),data:new Uint8Array(o(this,te)),written:[],shouldFlush:!1};return o(this,O).push(r),o(this,O).sort((i,s)=>i.start-s.start),o(this,O).indexOf(r)};je=new WeakSet;Pt=function(t=!1){for(let e=0;e<o(this,O).length;e++){let r=o(this,O)[e];if(!(!r.shouldFlush&&!t)){for(let i of r.written){if(o(this,He)&&r.start+i.start<o(this,Te))throw new Error("Internal error: Monotonicity violation.");this.target.options.onData?.(r.data.subarray(i.start,i.end),r.start+i.start),_(this,Te,r.start+i.end)}o(this,O).splice(e--,1)}}};var Qs=class extends Er{constructor(t,e){super(new ki({onData:(r,i)=>t.stream.write({type:"write",data:r,position:i}),chunked:!0,chunkSize:t.options?.chunkSize}),e)}},ze=1,Je=2,Lt=3,Zs=1,Js=2,en=17,tn=2**15,qe=2**13,bi="webm-muxer",Pi=6,Li=5,rn=["strict","offset","permissive"],x,y,et,tt,ee,Ce,Se,be,Re,ce,Me,Ae,X,nt,Pe,ae,oe,me,Ke,Ye,Le,Ue,Ut,rt,Xe,pr,Ui,gr,Bi,_r,zi,Tr,Ci,Mr,Ri,Ar,$i,Pr,Ii,Rt,Lr,$t,Ur,Br,Ni,pe,Ee,ge,_e,wr,Wi,br,Vi,Fe,_t,Oe,Tt,zr,Gi,Y,J,Be,it,Qe,Bt,Cr,Fi,zt,Rr,De,Mt,Oi=class{constructor(t){w(this,pr),w(this,gr),w(this,_r),w(this,Tr),w(this,Mr),w(this,Ar),w(this,Pr),w(this,Rt),w(this,$t),w(this,Br),w(this,pe),w(this,ge),w(this,wr),w(this,br),w(this,Fe),w(this,Oe),w(this,zr),w(this,Y),w(this,Be),w(this,Qe),w(this,Cr),w(this,zt),w(this,De),w(this,x,void 0),w(this,y,void 0),w(this,et,void 0),w(this,tt,void 0),w(this,ee,void 0),w(this,Ce,void 0),w(this,Se,void 0),w(this,be,void 0),w(this,Re,void 0),w(this,ce,void 0),w(this,Me,void 0),w(this,Ae,void 0),w(this,X,void 0),w(this,nt,void 0),w(this,Pe,0),w(this,ae,[]),w(this,oe,[]),w(this,me,[]),w(this,Ke,void 0),w(this,Ye,void 0),w(this,Le,-1),w(this,Ue,-1),w(this,Ut,-1),w(this,rt,void 0),w(this,Xe,!1),b(this,pr,Ui).call(this,t),_(this,x,{type:"webm",firstTimestampBehavior:"strict",...t}),this.target=t.target;let e=!!o(this,x).streaming;if(t.target instanceof kr)_(this,y,new Ks(t.target));else if(t.target instanceof ki)_(this,y,new Er(t.target,e));else if(t.target instanceof qs)_(this,y,new Qs(t.target,e));else throw new Error(`Invalid target: ${t.target}`);b(this,gr,Bi).call(this)}addVideoChunk(t,e,r){if(!(t instanceof EncodedVideoChunk))throw new TypeError("addVideoChunk's first argument (chunk) must be of type EncodedVideoChunk.");if(e&&typeof e!="object")throw new TypeError("addVideoChunk's second argument (meta), when provided, must be an object.");if(r!==void 0&&(!Number.isFinite(r)||r<0))throw new TypeError("addVideoChunk's third argument (timestamp), when provided, must be a non-negative real number.");let i=new Uint8Array(t.byteLength);t.copyTo(i),this.addVideoChunkRaw(i,t.type,r??t.timestamp,e)}addVideoChunkRaw(t,e,r,i){if(!(t instanceof Uint8Array))throw new TypeError("addVideoChunkRaw's first argument (data) must be an instance of Uint8Array.");if(e!=="key"&&e!=="delta")throw new TypeError("addVideoChunkRaw's second argument (type) must be either 'key' or 'delta'.");if(!Number.isFinite(r)||r<0)throw new TypeError("addVideoChunkRaw's third argument (timestamp) must be a non-negative real number.");if(i&&typeof i!="object")throw new TypeError("addVideoChunkRaw's fourth argument (meta), when provided, must be an object.");if(b(this,De,Mt).call(this),!o(this,x).video)throw new Error("No video track declared.");o(this,Ke)===void 0&&_(this,Ke,r),i&&b(this,wr,Wi).call(this,i);let s=b(this,Oe,Tt).call(this,t,e,r,ze);for(o(this,x).video.codec==="V_VP9"&&b(this,br,Vi).call(this,s),_(this,Le,s.timestamp);o(this,oe).length>0&&o(this,oe)[0].timestamp<=s.timestamp;){let n=o(this,oe).shift();b(this,Y,J).call(this,n,!1)}!o(this,x).audio||s.timestamp<=o(this,Ue)?b(this,Y,J).call(this,s,!0):o(this,ae).push(s),b(this,Fe,_t).call(this),b(this,pe,Ee).call(this)}addAudioChunk(t,e,r){if(!(t instanceof EncodedAudioChunk))throw new TypeError("addAudioChunk's first argument (chunk) must be of type EncodedAudioChunk.");if(e&&typeof e!="object")throw new TypeError("addAudioChunk's second argument (meta), when provided, must be an object.");if(r!==void 0&&(!Number.isFinite(r)||r<0))throw new TypeError("addAudioChunk's third argument (timestamp), when provided, must be a non-negative real number.");let i=new Uint8Array(t.byteLength);t.copyTo(i),this.addAudioChunkRaw(i,t.type,r??t.timestamp,e)}addAudioChunkRaw(t,e,r,i){if(!(t instanceof Uint8Array))throw new TypeError("addAudioChunkRaw's first argument (data) must be an instance of Uint8Array.");if(e!=="key"&&e!=="delta")throw new TypeError("addAudioChunkRaw's second argument (type) must be either 'key' or 'delta'.");if(!Number.isFinite(r)||r<0)throw new TypeError("addAudioChunkRaw's third argument (timestamp) must be a non-negative real number.");if(i&&typeof i!="object")throw new TypeError("addAudioChunkRaw's fourth argument (meta), when provided, must be an object.");if(b(this,De,Mt).call(this),!o(this,x).audio)throw new Error("No audio track declared.");o(this,Ye)===void 0&&_(this,Ye,r),i?.decoderConfig&&(o(this,x).streaming?_(this,ce,b(this,Be,it).call(this,i.decoderConfig.description)):b(this,Qe,Bt).call(this,o(this,ce),i.decoderConfig.description));let s=b(this,Oe,Tt).call(this,t,e,r,Je);for(_(this,Ue,s.timestamp);o(this,ae).length>0&&o(this,ae)[0].timestamp<=s.timestamp;){let n=o(this,ae).shift();b(this,Y,J).call(this,n,!0)}!o(this,x).video||s.timestamp<=o(this,Le)?b(this,Y,J).call(this,s,!o(this,x).video):o(this,oe).push(s),b(this,Fe,_t).call(this),b(this,pe,Ee).call(this)}addSubtitleChunk(t,e,r){if(typeof t!="object"||!t)throw new TypeError("addSubtitleChunk's first argument (chunk) must be an object.");if(!(t.body instanceof Uint8Array))throw new TypeError("body must be an instance of Uint8Array.");if(!Number.isFinite(t.timestamp)||t.timestamp<0)throw new TypeError("timestamp must be a non-negative real number.");if(!Number.isFinite(t.duration)||t.duration<0)throw new TypeError("duration must be a non-negative real number.");if(t.additions&&!(t.additions instanceof Uint8Array))throw new TypeError("additions, when present, must be an instance of Uint8Array.");if(typeof e!="object")throw new TypeError("addSubtitleChunk's second argument (meta) must be an object.");if(b(this,De,Mt).call(this),!o(this,x).subtitles)throw new Error("No subtitle track declared.");e?.decoderConfig&&(o(this,x).streaming?_(this,Me,b(this,Be,it).call(this,e.decoderConfig.description)):b(this,Qe,Bt).call(this,o(this,Me),e.decoderConfig.description));let i=b(this,Oe,Tt).call(this,t.body,"key",r??t.timestamp,Lt,t.duration,t.additions);_(this,Ut,i.timestamp),o(this,me).push(i),b(this,Fe,_t).call(this),b(this,pe,Ee).call(this)}finalize(){if(o(this,Xe))throw new Error("Cannot finalize a muxer more than once.");for(;o(this,ae).length>0;)b(this,Y,J).call(this,o(this,ae).shift(),!0);for(;o(this,oe).length>0;)b(this,Y,J).call(this,o(this,oe).shift(),!0);for(;o(this,me).length>0&&o(this,me)[0].timestamp<=o(this,Pe);)b(this,Y,J).call(this,o(this,me).shift(),!1);if(o(this,X)&&b(this,zt,Rr).call(this),o(this,y).writeEBML(o(this,Ae)),!o(this,x).streaming){let t=o(this,y).pos,e=o(this,y).pos-o(this,ge,_e);o(this,y).seek(o(this,y).offsets.get(o(this,et))+4),o(this,y).writeEBMLVarInt(e,Pi),o(this,Se).data=new vr(o(this,Pe)),o(this,y).seek(o(this,y).offsets.get(o(this,Se))),o(this,y).writeEBML(o(this,Se)),o(this,ee).data[0].data[1].data=o(this,y).offsets.get(o(this,Ae))-o(this,ge,_e),o(this,ee).data[1].data[1].data=o(this,y).offsets.get(o(this,tt))-o(this,ge,_e),o(this,ee).data[2].data[1].data=o(this,y).offsets.get(o(this,Ce))-o(this,ge,_e),o(this,y).seek(o(this,y).offsets.get(o(this,ee))),o(this,y).writeEBML(o(this,ee)),o(this,y).seek(t)}b(this,pe,Ee).call(this),o(this,y).finalize(),_(this,Xe,!0)}};x=new WeakMap;y=new WeakMap;et=new WeakMap;tt=new WeakMap;ee=new WeakMap;Ce=new WeakMap;Se=new WeakMap;be=new WeakMap;Re=new WeakMap;ce=new WeakMap;Me=new WeakMap;Ae=new WeakMap;X=new WeakMap;nt=new WeakMap;Pe=new WeakMap;ae=new WeakMap;oe=new WeakMap;me=new WeakMap;Ke=new WeakMap;Ye=new WeakMap;Le=new WeakMap;Ue=new WeakMap;Ut=new WeakMap;rt=new WeakMap;Xe=new WeakMap;pr=new WeakSet;Ui=function(t){if(typeof t!="object")throw new TypeError("The muxer requires an options object to be passed to its constructor.");if(!(t.target instanceof Ct))throw new TypeError("The target must be provided and an instance of Target.");if(t.video){if(typeof t.video.codec!="string")throw new TypeError(`Invalid video codec: ${t.video.codec}. Must be a string.`);if(!Number.isInteger(t.video.width)||t.video.width<=0)throw new TypeError(`Invalid video width: ${t.video.width}. Must be a positive integer.`);if(!Number.isInteger(t.video.height)||t.video.height<=0)throw new TypeError(`Invalid video height: ${t.video.height}. Must be a positive integer.`);if(t.video.frameRate!==void 0&&(!Number.isFinite(t.video.frameRate)||t.video.frameRate<=0))throw new TypeError(`Invalid video frame rate: ${t.video.frameRate}. Must be a positive number.`);if(t.video.alpha!==void 0&&typeof t.video.alpha!="boolean")throw new TypeError(`Invalid video alpha: ${t.video.alpha}. Must be a boolean.`)}if(t.audio){if(typeof t.audio.codec!="string")throw new TypeError(`Invalid audio codec: ${t.audio.codec}. Must be a string.`);if(!Number.isInteger(t.audio.numberOfChannels)||t.audio.numberOfChannels<=0)throw new TypeError(`Invalid number of audio channels: ${t.audio.numberOfChannels}. Must be a positive integer.`);if(!Number.isInteger(t.audio.sampleRate)||t.audio.sampleRate<=0)throw new TypeError(`Invalid audio sample rate: ${t.audio.sampleRate}. Must be a positive integer.`);if(t.audio.bitDepth!==void 0&&(!Number.isInteger(t.audio.bitDepth)||t.audio.bitDepth<=0))throw new TypeError(`Invalid audio bit depth: ${t.audio.bitDepth}. Must be a positive integer.`)}if(t.subtitles&&typeof t.subtitles.codec!="string")throw new TypeError(`Invalid subtitles codec: ${t.subtitles.codec}. Must be a string.`);if(t.type!==void 0&&!["webm","matroska"].includes(t.type))throw new TypeError(`Invalid type: ${t.type}. Must be 'webm' or 'matroska'.`);if(t.firstTimestampBehavior&&!rn.includes(t.firstTimestampBehavior))throw new TypeError(`Invalid first timestamp behavior: ${t.firstTimestampBehavior}`);if(t.streaming!==void 0&&typeof t.streaming!="boolean")throw new TypeError(`Invalid streaming option: ${t.streaming}. Must be a boolean.`)};gr=new WeakSet;Bi=function(){o(this,y)instanceof st&&o(this,y).target.options.onHeader&&o(this,y).startTrackingWrites(),b(this,_r,zi).call(this),o(this,x).streaming||b(this,Ar,$i).call(this),b(this,Pr,Ii).call(this),b(this,Tr,Ci).call(this),b(this,Mr,Ri).call(this),o(this,x).streaming||(b(this,Rt,Lr).call(this),b(this,$t,Ur).call(this)),b(this,Br,Ni).call(this),b(this,pe,Ee).call(this)};_r=new WeakSet;zi=function(){let t={id:440786851,data:[{id:17030,data:1},{id:17143,data:1},{id:17138,data:4},{id:17139,data:8},{id:17026,data:o(this,x).type??"webm"},{id:17031,data:2},{id:17029,data:2}]};o(this,y).writeEBML(t)};Tr=new WeakSet;Ci=function(){_(this,Re,{id:236,size:4,data:new Uint8Array(qe)}),_(this,ce,{id:236,size:4,data:new Uint8Array(qe)}),_(this,Me,{id:236,size:4,data:new Uint8Array(qe)})};Mr=new WeakSet;Ri=function(){_(this,be,{id:21936,data:[{id:21937,data:2},{id:21946,data:2},{id:21947,data:2},{id:21945,data:0}]})};Ar=new WeakSet;$i=function(){let t=new Uint8Array([28,83,187,107]),e=new Uint8Array([21,73,169,102]),r=new Uint8Array([22,84,174,107]);_(this,ee,{id:290298740,data:[{id:19899,data:[{id:21419,data:t},{id:21420,size:5,data:0}]},{id:19899,data:[{id:21419,data:e},{id:21420,size:5,data:0}]},{id:19899,data:[{id:21419,data:r},{id:21420,size:5,data:0}]}]})};Pr=new WeakSet;Ii=function(){let t={id:17545,data:new vr(0)};_(this,Se,t);let e={id:357149030,data:[{id:2807729,data:1e6},{id:19840,data:bi},{id:22337,data:bi},o(this,x).streaming?null:t]};_(this,tt,e)};Rt=new WeakSet;Lr=function(){let t={id:374648427,data:[]};_(this,Ce,t),o(this,x).video&&t.data.push({id:174,data:[{id:215,data:ze},{id:29637,data:ze},{id:131,data:Zs},{id:134,data:o(this,x).video.codec},o(this,Re),o(this,x).video.frameRate?{id:2352003,data:1e9/o(this,x).video.frameRate}:null,{id:224,data:[{id:176,data:o(this,x).video.width},{id:186,data:o(this,x).video.height},o(this,x).video.alpha?{id:21440,data:1}:null,o(this,be)]}]}),o(this,x).audio&&(_(this,ce,o(this,x).streaming?o(this,ce)||null:{id:236,size:4,data:new Uint8Array(qe)}),t.data.push({id:174,data:[{id:215,data:Je},{id:29637,data:Je},{id:131,data:Js},{id:134,data:o(this,x).audio.codec},o(this,ce),{id:225,data:[{id:181,data:new yi(o(this,x).audio.sampleRate)},{id:159,data:o(this,x).audio.numberOfChannels},o(this,x).audio.bitDepth?{id:25188,data:o(this,x).audio.bitDepth}:null]}]})),o(this,x).subtitles&&t.data.push({id:174,data:[{id:215,data:Lt},{id:29637,data:Lt},{id:131,data:en},{id:134,data:o(this,x).subtitles.codec},o(this,Me)]})};$t=new WeakSet;Ur=function(){let t={id:408125543,size:o(this,x).streaming?-1:Pi,data:[o(this,x).streaming?null:o(this,ee),o(this,tt),o(this,Ce)]};if(_(this,et,t),o(this,y).writeEBML(t),o(this,y)instanceof st&&o(this,y).target.options.onHeader){let{data:e,start:r}=o(this,y).getTrackedWrites();o(this,y).target.options.onHeader(e,r)}};Br=new WeakSet;Ni=function(){_(this,Ae,{id:475249515,data:[]})};pe=new WeakSet;Ee=function(){o(this,y)instanceof Er&&o(this,y).flush()};ge=new WeakSet;_e=function(){return o(this,y).dataOffsets.get(o(this,et))};wr=new WeakSet;Wi=function(t){if(t.decoderConfig){if(t.decoderConfig.colorSpace){let e=t.decoderConfig.colorSpace;if(_(this,rt,e),o(this,be).data=[{id:21937,data:{rgb:1,bt709:1,bt470bg:5,smpte170m:6}[e.matrix]},{id:21946,data:{bt709:1,smpte170m:6,"iec61966-2-1":13}[e.transfer]},{id:21947,data:{bt709:1,bt470bg:5,smpte170m:6}[e.primaries]},{id:21945,data:[1,2][Number(e.fullRange)]}],!o(this,x).streaming){let r=o(this,y).pos;o(this,y).seek(o(this,y).offsets.get(o(this,be))),o(this,y).writeEBML(o(this,be)),o(this,y).seek(r)}}t.decoderConfig.description&&(o(this,x).streaming?_(this,Re,b(this,Be,it).call(this,t.decoderConfig.description)):b(this,Qe,Bt).call(this,o(this,Re),t.decoderConfig.description))}};br=new WeakSet;Vi=function(t){if(t.type!=="key"||!o(this,rt))return;let e=0;if(ke(t.data,0,2)!==2)return;e+=2;let r=(ke(t.data,e+1,e+2)<<1)+ke(t.data,e+0,e+1);e+=2,r===3&&e++;let i=ke(t.data,e+0,e+1);if(e++,i)return;let s=ke(t.data,e+0,e+1);if(e++,s!==0)return;e+=2;let n=ke(t.data,e+0,e+24);if(e+=24,n!==4817730)return;r>=2&&e++;let a={rgb:7,bt709:2,bt470bg:1,smpte170m:3}[o(this,rt).matrix];js(t.data,e+0,e+3,a)};Fe=new WeakSet;_t=function(){let t=Math.min(o(this,x).video?o(this,Le):1/0,o(this,x).audio?o(this,Ue):1/0),e=o(this,me);for(;e.length>0&&e[0].timestamp<=t;)b(this,Y,J).call(this,e.shift(),!o(this,x).video&&!o(this,x).audio)};Oe=new WeakSet;Tt=function(t,e,r,i,s,n){let a=b(this,zr,Gi).call(this,r,i);return{data:t,additions:n,type:e,timestamp:a,duration:s,trackNumber:i}};zr=new WeakSet;Gi=function(t,e){let r=e===ze?o(this,Le):e===Je?o(this,Ue):o(this,Ut);if(e!==Lt){let i=e===ze?o(this,Ke):o(this,Ye);if(o(this,x).firstTimestampBehavior==="strict"&&r===-1&&t!==0)throw new Error(`The first chunk for your media track must have a timestamp of 0 (received ${t}). Non-zero first timestamps are often caused by directly piping frames or audio data from a MediaStreamTrack into the encoder. Their timestamps are typically relative to the age of the document, which is probably what you want.

If you want to offset all timestamps of a track such that the first one is zero, set firstTimestampBehavior: 'offset' in the options.
If you want to allow non-zero first timestamps, set firstTimestampBehavior: 'permissive'.
`);o(this,x).firstTimestampBehavior==="offset"&&(t-=i)}if(t<r)throw new Error(`Timestamps must be monotonically increasing (went from ${r} to ${t}).`);if(t<0)throw new Error(`Timestamps must be non-negative (received ${t}).`);return t};Y=new WeakSet;J=function(t,e){o(this,x).streaming&&!o(this,Ce)&&(b(this,Rt,Lr).call(this),b(this,$t,Ur).call(this));let r=Math.floor(t.timestamp/1e3),i=r-o(this,nt),s=e&&t.type==="key"&&i>=1e3,n=i>=tn;if((!o(this,X)||s||n)&&(b(this,Cr,Fi).call(this,r),i=0),i<0)return;let a=new Uint8Array(4),l=new DataView(a.buffer);if(l.setUint8(0,128|t.trackNumber),l.setInt16(1,i,!1),t.duration===void 0&&!t.additions){l.setUint8(3,+(t.type==="key")<<7);let c={id:163,data:[a,t.data]};o(this,y).writeEBML(c)}else{let c=Math.floor(t.duration/1e3),u={id:160,data:[{id:161,data:[a,t.data]},t.duration!==void 0?{id:155,data:c}:null,t.additions?{id:30113,data:t.additions}:null]};o(this,y).writeEBML(u)}_(this,Pe,Math.max(o(this,Pe),r))};Be=new WeakSet;it=function(t){return{id:25506,size:4,data:new Uint8Array(t)}};Qe=new WeakSet;Bt=function(t,e){let r=o(this,y).pos;o(this,y).seek(o(this,y).offsets.get(t));let i=6+e.byteLength,s=qe-i;if(s<0){let n=e.byteLength+s;e instanceof ArrayBuffer?e=e.slice(0,n):e=e.buffer.slice(0,n),s=0}t=[b(this,Be,it).call(this,e),{id:236,size:4,data:new Uint8Array(s)}],o(this,y).writeEBML(t),o(this,y).seek(r)};Cr=new WeakSet;Fi=function(t){o(this,X)&&b(this,zt,Rr).call(this),o(this,y)instanceof st&&o(this,y).target.options.onCluster&&o(this,y).startTrackingWrites(),_(this,X,{id:524531317,size:o(this,x).streaming?-1:Li,data:[{id:231,data:t}]}),o(this,y).writeEBML(o(this,X)),_(this,nt,t);let e=o(this,y).offsets.get(o(this,X))-o(this,ge,_e);o(this,Ae).data.push({id:187,data:[{id:179,data:t},o(this,x).video?{id:183,data:[{id:247,data:ze},{id:241,data:e}]}:null,o(this,x).audio?{id:183,data:[{id:247,data:Je},{id:241,data:e}]}:null]})};zt=new WeakSet;Rr=function(){if(!o(this,x).streaming){let t=o(this,y).pos-o(this,y).dataOffsets.get(o(this,X)),e=o(this,y).pos;o(this,y).seek(o(this,y).offsets.get(o(this,X))+4),o(this,y).writeEBMLVarInt(t,Li),o(this,y).seek(e)}if(o(this,y)instanceof st&&o(this,y).target.options.onCluster){let{data:t,start:e}=o(this,y).getTrackedWrites();o(this,y).target.options.onCluster(t,e,o(this,nt))}};De=new WeakSet;Mt=function(){if(o(this,Xe))throw new Error("Cannot add new video or audio chunks after the file has been finalized.")};var sn=/(?:(\d{2}):)?(\d{2}):(\d{2}).(\d{3})/;var Qa=new TextEncoder,nn,an,on,ln,cn,un,hn,dn,fn;nn=new WeakMap;an=new WeakMap;on=new WeakMap;ln=new WeakMap;cn=new WeakMap;un=new WeakSet;hn=function(t){let e=sn.exec(t);if(!e)throw new Error("Expected match.");return 3600*1e3*Number(e[1]||"0")+60*1e3*Number(e[2])+1e3*Number(e[3])+Number(e[4])};dn=new WeakSet;fn=function(t){let e=Math.floor(t/36e5),r=Math.floor(t%(3600*1e3)/(60*1e3)),i=Math.floor(t%(60*1e3)/1e3),s=t%1e3;return e.toString().padStart(2,"0")+":"+r.toString().padStart(2,"0")+":"+i.toString().padStart(2,"0")+"."+s.toString().padStart(3,"0")};var mn=[["vp09.00.40.08","V_VP9"],["vp8","V_VP8"]],Di=12e6,pn=24;function Hi({canvas:t}){let e=r=>2*Math.max(Math.round(r/2),8);return[e(t.width),e(t.height)]}async function ji(t,e,r){return new ImageData(await t.stage.pixels(e,r),e,r)}async function qi(t){let[e,r]=Hi(t),i=new OffscreenCanvas(e,r);return i.getContext("2d").putImageData(await ji(t,e,r),0,0),i.convertToBlob({type:"image/png"})}async function Ki(t,e){if(!("VideoEncoder"in globalThis))throw new P("This browser encodes no films.");let[r,i]=Hi(t),s=t.smoke.fps*t.speed,[n,a]=await gn(r,i,s),l=new kr,c={codec:a,width:r,height:i,frameRate:s},u=new Oi({target:l,video:c}),h=null,f=new VideoEncoder({output:(d,m)=>u.addVideoChunk(d,m),error:d=>h=d});f.configure({codec:n,width:r,height:i,framerate:s,bitrate:Di});for(let d=0;d<t.smoke.length;d++){d===0?await t.restart():await t.goTo(d);let m=Math.round(1e6*d/s),p=await ji(t,r,i),g=new VideoFrame(p.data,{format:"RGBA",codedWidth:r,codedHeight:i,timestamp:m,duration:Math.round(1e6/s)});if(f.encode(g,{keyFrame:d%pn===0}),g.close(),h!==null)throw h;e((d+1)/t.smoke.length)}return await f.flush(),u.finalize(),new Blob([l.buffer],{type:"video/webm"})}async function gn(t,e,r){for(let i of mn){let s={codec:i[0],width:t,height:e,framerate:r,bitrate:Di};if((await VideoEncoder.isConfigSupported(s)).supported)return i}throw new P("This browser encodes no WebM films.")}function $r(t,e,r){let i=e.names.filter(Boolean).join("_"),s=r==="png"?`_${e.smoke.number(Math.max(e.stage.at,0))}`:"";ii(t,`${e.smoke.name}_${i}${s}.${r}`.replace(/[^\w.-]+/g,"_"))}var re={orbit:"M12 4a8 8 0 1 0 8 8M20 4v5h-5",erase:"M4 15l8.5-8.5 6 6L12 19H8zM9 10l6 6M8 19h12",more:"M12 4v16M4 12h16",less:"M4 12h16",beside:"M4 5h16v14H4zM12 5v14",alive:"M3 12h4l3-7 4 14 3-7h4",picture:"M4 7h4l1.5-2h5L16 7h4v12H4zM12 16.5a3.5 3.5 0 1 0 0-7 3.5 3.5 0 0 0 0 7z",film:"M4 6h11v12H4zM15 10.5l5-3v9l-5-3z",link:"M10 14a4 4 0 0 0 6 0l3-3a4 4 0 0 0-6-6l-1 1M14 10a4 4 0 0 0-6 0l-3 3a4 4 0 0 0 6 6l1-1",home:"M4 11l8-7 8 7M6 10v9h12v-9",help:"M9 9a3 3 0 1 1 4.2 2.7c-.8.4-1.2 1-1.2 1.8v.5M12 17.4v.1",settings:"M4 8h9M17 8h3M4 16h3M11 16h9M15 6v4M9 14v4"},wn=[["orbit","Turn, pan and zoom (1)"],["erase","Erase the painting; it heals (2)"],["more","Brush the second style on (3)"],["less","Brush the second style off (4)"]];function Yi(t){let e=wn.map(([n,a])=>{let l=F(a,re[n],()=>$e(t,n));return l.id=`tool-${n}`,[n,l]}),r=F("Beside the plain smoke (B)",re.beside,()=>Nr(t)),i=F("Goes on while nothing plays (L)",re.alive,()=>Wr(t)),s=()=>{for(let[n,a]of e)a.setAttribute("aria-pressed",String(t.tool===n));r.setAttribute("aria-pressed",String(t.stage.settings.wipe<1)),i.setAttribute("aria-pressed",String(t.isAlive)),t.canvas.dataset.tool=t.tool};return t.addEventListener("change",s),s(),k("div",{id:"tools",role:"toolbar","aria-label":"Tools"},...e.map(([,n])=>n),k("hr"),r,i,F("Frame the smoke (F)",re.home,()=>t.reframe()),k("hr"),F("Save a picture (P)",re.picture,()=>{Vr(t)}),F("Save a film",re.film,()=>{bn(t)}),F("Copy a link to what is seen (C)",re.link,()=>{Gr(t)}),F("Settings (H)",re.settings,Ir),F("What can be done (?)",re.help,vt))}function Ir(){document.body.classList.toggle("bare")}function $e(t,e){t.tool=e,t.changed()}function Nr(t){t.set("wipe",t.stage.settings.wipe<1?2:.5)}function Wr(t){t.isAlive=!t.isAlive,t.changed()}async function Vr(t){try{$r(await qi(t),t,"png")}catch(e){$(R(e))}}async function bn(t){let e=t.isAlive;t.pause(),t.isAlive=!1;try{let r=await Ki(t,i=>$(`Filming: ${Math.round(100*i)} %`));$r(r,t,"webm")}catch(r){$(R(r))}finally{t.isAlive=e}}async function Gr(t){let e=pi(t);history.replaceState(null,"",e);try{await navigator.clipboard.writeText(e),$("The link is copied.")}catch{$("The link is in the address bar.")}}var Xi="M8 5.5v13l11-6.5z",yn="M8 5.5v13M16 5.5v13",vn="M18 6.5v11L9 12zM6.5 6.5v11",Fr=[.25,.5,1,2];function Qi(t){let e=t.smoke.length-1,r=F("Play (space)",Xi,()=>{Or(t)});r.id="play";let i=k("input",{type:"range",min:0,max:Math.max(e,1),step:1,id:"scrub","aria-label":"Frame"});i.disabled=e<1;let s=k("output",{id:"frame"}),n=k("button",{type:"button",id:"speed",title:"Speed"});n.addEventListener("click",()=>{let c=(Fr.indexOf(t.speed)+1)%Fr.length;t.speed=Fr[c],t.changed()});let a=!1;i.addEventListener("input",async()=>{if(!a){for(a=!0,t.pause();t.stage.at!==Number(i.value);)await t.goTo(Number(i.value));a=!1}});let l=()=>{let c=Math.max(t.stage.at,0);a||(i.value=String(c)),i.style.setProperty("--part",`${100*c/Math.max(e,1)}%`),s.textContent=String(t.smoke.number(c)),n.textContent=`${t.speed}×`,r.querySelector("path").setAttribute("d",t.isPlaying?yn:Xi),r.classList.toggle("playing",t.isPlaying)};return t.addEventListener("change",l),t.addEventListener("frame",l),l(),k("div",{id:"transport",role:"group","aria-label":"Play"},F("From the beginning (R)",vn,()=>{t.restart()}),r,i,s,n)}async function Or(t){t.isPlaying?t.pause():await t.play()}function Zi(t){let e={" ":()=>{Or(t)},r:()=>{t.restart()},f:()=>t.reframe(),b:()=>Nr(t),l:()=>Wr(t),p:()=>{Vr(t)},c:()=>{Gr(t)},h:Ir,n:()=>{kn(t)},"?":vt,1:()=>$e(t,"orbit"),2:()=>$e(t,"erase"),3:()=>$e(t,"more"),4:()=>$e(t,"less"),"+":()=>t.look(r=>Ve(r,.9,0,1/0)),"-":()=>t.look(r=>Ve(r,1.1,0,1/0)),ArrowLeft:r=>It(t,r,-1,0),ArrowRight:r=>It(t,r,1,0),ArrowUp:r=>It(t,r,0,1),ArrowDown:r=>It(t,r,0,-1)};document.addEventListener("keydown",r=>{let i=r.target instanceof HTMLInputElement||r.target instanceof HTMLSelectElement,s=document.getElementById("help")?.open??!1;if(r.ctrlKey||r.metaKey||r.altKey||i||s&&r.key!=="?")return;let n=e[r.key.length===1?r.key.toLowerCase():r.key];n!==void 0&&(r.preventDefault(),n(r))})}function It(t,e,r,i){e.shiftKey||i!==0?t.look(s=>ir(s,4*r,4*i)):(t.pause(),t.goTo(t.stage.at+r))}async function kn(t){let{rules:e}=t.show,r=e.findIndex(i=>i.name===t.names[0]);await t.use(e[(r+1)%e.length].name,0)}var xn=[["Paint",[{name:"strength",label:"Colour",low:0,high:1,step:.01,hint:"From white smoke to the colours of the style"},{name:"densityStrength",label:"Density change",low:0,high:1,step:.01,hint:"How much the style thins and thickens the smoke"},{name:"density",label:"Opacity",low:.02,high:20,step:.01,log:!0,unit:"×",hint:"Extinction γ, as a multiple of the style's own"},{name:"steps",label:"Steps a frame",low:0,high:64,step:1,hint:"How long the rule works between two frames; 0 is as in its training"},{name:"patternSpeed",label:"Pattern speed",low:0,high:2,step:.05,unit:"×",hint:"How fast the smoke carries the pattern from frame to frame: 0 stands, 1 goes along, 2 runs ahead"},{name:"detail",label:"Detail",low:1,high:3,step:1,unit:"×",hint:"Parts of a cell that are drawn, as by --refine"},{name:"half",label:"16-bit steps",low:0,high:1,step:1,hint:"Quicker, and a little rounder"},{name:"seed",label:"Seed",low:0,high:99,step:1,hint:"Another seed, another painting of the same style"}]],["Light",[{name:"light",label:"Light",low:0,high:3,step:.05,hint:"0: the smoke glows by itself"},{name:"lightAzimuth",label:"Around",low:-180,high:180,step:1,unit:"°",hint:"Where the light stands"},{name:"lightElevation",label:"Above",low:-90,high:90,step:1,unit:"°",hint:"How high it stands"},{name:"ambient",label:"Shadows",low:0,high:1,step:.01,hint:"How bright shadows are"},{name:"exposure",label:"Exposure",low:-3,high:3,step:.05,unit:" EV",hint:"Brightness of the picture"}]],["Guide",[{name:"guide",label:"Pull",low:0,high:1,step:.01,hint:"How much the pattern follows this direction instead of the smoke's motion"},{name:"guideAzimuth",label:"Around",low:-180,high:180,step:1,unit:"°",hint:"Direction of the pull"},{name:"guideElevation",label:"Up",low:-90,high:90,step:1,unit:"°",hint:"Direction of the pull"}]],["Brush and mix",[{name:"mix",label:"Second style",low:0,high:1,step:.01,hint:"How much of the second style is seen"},{name:"brush",label:"Brush",low:1,high:24,step:.5,unit:" cells",hint:"Radius of the brushes"}]]];function Ji(t){let e=k("aside",{id:"panel","aria-label":"Settings"}),r=[];for(let[s,n]of xn){let a=k("details",{open:s!=="Guide"},k("summary",{},s));for(let l of n)l.name==="half"&&!t.gpu.hasHalf||a.append(Sn(t,l,r));e.append(a)}let i=()=>r.forEach(s=>s());return t.addEventListener("change",i),i(),e}function Sn(t,e,r){let{name:i,label:s,low:n,high:a,step:l,log:c=!1,unit:u="",hint:h}=e,f=k("input",{type:"range",min:c?Math.log(n):n,max:c?Math.log(a):a,step:c?"any":l,"aria-label":s,id:`set-${i}`}),d=k("output",{});f.addEventListener("input",()=>{let g=Number(f.value);t.set(i,c?Number(Math.exp(g).toPrecision(3)):g)});let p=k("label",{class:"slider",title:h,ondblclick:()=>{t.set(i,t.show.settings[i]??t.defaults[i])}},k("span",{},s),d,f);return r.push(()=>{let g=En(t,i),S=c?Math.log(g):g;Number(f.value)!==S&&(f.value=String(S));let E=Number(f.min),v=(S-E)/(Number(f.max)-E);f.style.setProperty("--part",`${100*Math.min(Math.max(v,0),1)}%`),d.textContent=_n(t,i,g,u),p.classList.toggle("changed",!t.isDefault(i))}),p}function En(t,e){let[r]=t.stage.layers;return e==="patternSpeed"&&r!==void 0?t.stage.patternSpeed(r):t.stage.settings[e]}function _n(t,e,r,i){if(e==="steps"&&r===0)return`${t.stage.layers[0]?.rule.steps??""} as trained`;let s=t.stage.settings[e]<0&&e==="patternSpeed"?" as trained":"";return`${Number(r.toPrecision(3))}${i}${s}`}var Tn=["maxBufferSize","maxStorageBufferBindingSize","maxStorageBuffersPerShaderStage","maxTextureDimension3D","maxTextureDimension2D"],Mn=65535,Nt=class t{constructor(e,r,i){this.device=e;this.name=r;this.hasHalf=i;this.lost=e.lost}device;name;hasHalf;lost;modules=new Map;pipelines=new Map;drawings=new Map;static async open(){if(!("gpu"in navigator))throw new P("This browser has no WebGPU.");let e=await navigator.gpu.requestAdapter({powerPreference:"high-performance"});if(e===null)throw new P("This browser has WebGPU, but finds no GPU that it may use.");let r=e.features.has("shader-f16"),i={};for(let c of Tn)i[c]=e.limits[c];let s=await e.requestDevice({requiredFeatures:r?["shader-f16"]:[],requiredLimits:i}),{vendor:n,architecture:a,description:l}=e.info;return new t(s,l||`${n} ${a}`.trim()||"a GPU",r)}get bindable(){let{maxStorageBufferBindingSize:e,maxBufferSize:r}=this.device.limits;return Math.min(e,r)}requireBindings(e,r){let i=this.device.limits.maxStorageBuffersPerShaderStage;if(!(e<=i))throw new P(`${r}: arrays in ${e} parts of ${at(this.bindable)}, and this GPU binds at most ${i}: choose a smaller sequence or less detail.`)}buffer(e){let r=typeof e=="number"?e:e.byteLength,i=this.device.createBuffer({size:Math.max(16,Math.ceil(r/4)*4),usage:GPUBufferUsage.STORAGE|GPUBufferUsage.COPY_DST|GPUBufferUsage.COPY_SRC});return typeof e!="number"&&this.write(i,e),i}uniform(e){let r=GPUBufferUsage.UNIFORM|GPUBufferUsage.COPY_DST;return this.device.createBuffer({size:e,usage:r})}write(e,r,i=0){this.device.queue.writeBuffer(e,i,r.buffer,r.byteOffset,r.byteLength)}module(e){let r=this.modules.get(e);return r===void 0&&(r=this.device.createShaderModule({code:e}),this.modules.set(e,r)),r}async prepare(e){await Promise.all(e.map(async([r,i])=>{let s={module:this.module(r),entryPoint:i},n=await this.device.createComputePipelineAsync({layout:"auto",compute:s});this.pipelines.set(`${i}
${r}`,n)}))}compute(e,r){let i=`${r}
${e}`,s=this.pipelines.get(i);if(s===void 0){let n={module:this.module(e),entryPoint:r};s=this.device.createComputePipeline({layout:"auto",compute:n}),this.pipelines.set(i,s)}return s}async prepareRender(e,r,i){let s=await this.device.createRenderPipelineAsync(this.drawing(e,r,i));this.drawings.set(`${r} ${i}
${e}`,s)}render(e,r,i){let s=`${r} ${i}
${e}`,n=this.drawings.get(s);return n===void 0&&(n=this.device.createRenderPipeline(this.drawing(e,r,i)),this.drawings.set(s,n)),n}drawing(e,r,i){let s=this.module(e);return{layout:"auto",vertex:{module:s,entryPoint:"corner"},fragment:{module:s,entryPoint:r,targets:[{format:i}]}}}bound(e,r,i){let s=Object.entries(i).map(([n,a])=>({binding:Number(n),resource:a instanceof GPUBuffer?{buffer:a}:a}));return this.device.createBindGroup({layout:e.getBindGroupLayout(r),entries:s})}submit(e){let r=this.device.createCommandEncoder();e(r),this.device.queue.submit([r.finish()])}async read(e,r=e.size){let i=GPUBufferUsage.COPY_DST|GPUBufferUsage.MAP_READ,s=this.device.createBuffer({size:r,usage:i});this.submit(a=>a.copyBufferToBuffer(e,0,s,0,r)),await s.mapAsync(GPUMapMode.READ);let n=s.getMappedRange().slice(0);return s.destroy(),n}async pixels(e,r){let{width:i,height:s}=e,n=i*r,a=Math.ceil(n/256)*256,l=GPUBufferUsage.COPY_DST|GPUBufferUsage.MAP_READ,c=this.device.createBuffer({size:a*s,usage:l});this.submit(f=>f.copyTextureToBuffer({texture:e},{buffer:c,bytesPerRow:a},{width:i,height:s})),await c.mapAsync(GPUMapMode.READ);let u=new Uint8Array(c.getMappedRange()),h=new Uint8Array(n*s);for(let f=0;f<s;f++)h.set(u.subarray(f*a,f*a+n),f*n);return c.destroy(),h.buffer}};function N(t,e,r,i){let s=t.beginComputePass();if(s.setPipeline(e),r.forEach((n,a)=>s.setBindGroup(a,n)),typeof i=="number"){let n=Math.ceil(i/Mn)||1;s.dispatchWorkgroups(Math.ceil(i/n),n)}else s.dispatchWorkgroups(...i);s.end()}function at(t){return`${Number((t/2**20).toPrecision(3))} MiB`}var An=2**27;function ot(t,e){return t.device.createTexture({size:e,dimension:"3d",format:"rgba16float",usage:GPUTextureUsage.TEXTURE_BINDING|GPUTextureUsage.STORAGE_BINDING|GPUTextureUsage.COPY_SRC})}function Wt(t,{lower:e,upper:r},i){let s=e.map((l,c)=>(r[c]-l)*i+2),n=t.device.limits.maxTextureDimension3D,a=s.reduce((l,c)=>l*c,1);if(Math.max(...s)>n||a>An)throw new P(`A volume of ${s.join(" × ")} (${at(8*a)}) is more than this page draws: choose a smaller sequence or less detail.`);return s}function Ie(t,e){return C(ni(ne(t.toWorld),e),Vt(t))}function Vt(t){return Math.hypot(...[0,1,2].map(e=>t.toWorld[e][0]))}function es(t,e){let r=Vt(t)/e,[i,s]=Dr(t,t.toWorld);return[C(i,1/r),C(s,1/r)]}function Dr(t,e){let r=Array.from({length:8},(s,n)=>{let a=[0,1,2].map(l=>(n>>l&1?t.upper:t.lower)[l]-.5);return gt(e,a)}),i=s=>[0,1,2].map(n=>s(...r.map(a=>a[n])));return[i(Math.min),i(Math.max)]}function Gt(t){return t.map(e=>Math.ceil(e/4))}function ts(t){let e=k("div",{id:"ring","aria-hidden":"true"}),{canvas:r}=t,i=()=>{let{camera:n,settings:a}=t.stage,l=2*n.distance*Z(n.fieldOfView),c=2*a.brush*Vt(t.smoke)*r.clientHeight/l;e.style.width=e.style.height=`${c}px`,e.dataset.tool=t.tool};r.addEventListener("pointermove",n=>{e.classList.toggle("shown",t.tool!=="orbit"),e.style.left=`${n.clientX}px`,e.style.top=`${n.clientY}px`});let s=()=>e.classList.remove("shown");return r.addEventListener("pointerleave",s),r.addEventListener("pointerup",n=>{n.pointerType==="touch"&&s()}),t.addEventListener("change",()=>{i(),t.tool==="orbit"&&s()}),i(),e}async function rs(){let t;try{t=await(await fetch("show.json",{cache:"no-cache"})).json()}catch{throw new P("show.json is not there or damaged: this page has nothing to show.")}if(!(typeof t=="object"&&t!==null&&Array.isArray(t.rules)&&t.rules.length>0&&t.rules.every(Pn)&&Hr(t.smoke)&&typeof t.title=="string"&&typeof t.settings=="object"&&t.settings!==null))throw new P("show.json is damaged: this page has nothing to show.");return t}function Pn(t){return typeof t?.name=="string"&&Hr(t.model)&&(t.thumbnail===void 0||Hr(t.thumbnail))}function Hr(t){return typeof t=="string"&&/^[\w.-]+(\/[\w.-]+)*$/.test(t)&&!t.includes("..")}async function lt(t){let e=await fetch(t,{cache:"no-cache"});if(!e.ok)throw new P(`${t}: the server says ${e.status}`);return e.arrayBuffer()}var Ln=2e3,is=.8,ss=300,jr=64;function ns(t){let e=k("section",{id:"curves","aria-label":"Training"});document.body.append(e);let r="",i=async()=>{try{let s=JSON.parse(new TextDecoder().decode(await lt("run.json")));Un(e,s),s.model!==r&&(await t.learned(await lt(t.show.rules[0].model)),r=s.model)}catch{}setTimeout(()=>{i()},Ln)};i()}function Un(t,{iteration:e,iterations:r,curves:i}){let s=r>0?` of ${r}`:"",n=Object.entries(i).filter(([,a])=>a.length>1).map(([a,l])=>{let c=l[l.length-1][1],u=k("figcaption",{},a,k("output",{},String(Number(c.toPrecision(3)))));return k("figure",{},u,Bn(l))});t.replaceChildren(k("h2",{},`Iteration ${e}${s}`),...n)}function Bn(t){let e=t.filter(([,m])=>Number.isFinite(m)),r=e.every(([,m])=>m>0),i=e.map(([,m])=>r?Math.log(m):m),s=Math.min(...i),n=Math.max(...i)-s||1,a=e[0]?.[0]??0,l=(e[e.length-1]?.[0]??1)-a||1,c=m=>m.map((p,g)=>{let S=ss*(e[g][0]-a)/l;return`${g===0?"M":"L"}${S.toFixed(1)} ${(jr-jr*(p-s)/n).toFixed(1)}`}).join(""),u=i[0]??0,h=i.map(m=>u=is*u+(1-is)*m),f="http://www.w3.org/2000/svg",d=document.createElementNS(f,"svg");d.setAttribute("viewBox",`-2 -2 ${ss+4} ${jr+4}`);for(let[m,p]of[["raw",i],["mean",h]]){let g=document.createElementNS(f,"path");g.setAttribute("d",c(p)),g.setAttribute("class",m),d.append(g)}return d}var zn=500;function as(t){let e=k("nav",{id:"styles","aria-label":"Styles"}),r=new Map,i=async(c,u)=>{try{let h=u&&t.names[1]===c;await t.use(h?"":c,u?1:0)}catch(h){$(R(h))}},s=0,n=!1,a=()=>{for(let c of t.show.rules){if(r.has(c.name))continue;let u=k("button",{type:"button",title:`${c.title||c.name}. Right click, or hold: mix it with the one that paints`,onclick:h=>{n||i(c.name,h.shiftKey),n=!1},onpointerdown:h=>{n=!1,h.pointerType==="touch"&&(s=window.setTimeout(()=>{n=!0,i(c.name,!0)},zn))},onpointerup:()=>clearTimeout(s),onpointercancel:()=>clearTimeout(s),oncontextmenu:h=>{h.preventDefault(),n||i(c.name,!0),clearTimeout(s)}});c.thumbnail&&u.append(k("img",{src:c.thumbnail,alt:"",draggable:"false"})),u.append(k("span",{},c.name.replaceAll("_"," "))),r.set(c.name,u),c.model===""?e.prepend(u):e.append(u)}},l=()=>{a();for(let[c,u]of r)u.classList.toggle("first",t.names[0]===c),u.classList.toggle("second",t.names[1]===c),u.setAttribute("aria-pressed",String(t.names.includes(c)))};return t.addEventListener("rules",l),l(),e}var Cn=4,Rn=64*2**20,Ne={channels:64,hidden:1024,units:256,dilation:64,steps:4096,width:16},qr={position:3,density:1,velocity:3},$n=["first","second","third","output"];function Ft(t,e){try{return In(t,e)}catch(r){throw r instanceof P?r:new P(`${e}: damaged model`)}}function In(t,e){let r=(U,G)=>L(U,`${e}: ${G}`);r(t.byteLength>=8,"not a model of vnca"),r(t.byteLength<=Rn,"larger than any model of vnca");let i=Number(new DataView(t).getBigUint64(0,!0));r(i<=t.byteLength-8,"not a model of vnca");let s=os(new TextDecoder().decode(new Uint8Array(t,8,i)),e),n=s?.__metadata__?.vnca;r(typeof n=="string","not a model of vnca");let a=os(n,e);r(Number.isInteger(a.format_version)&&a.format_version>=1,"damaged model"),r(a.format_version<=Cn,`its format, ${a.format_version}, is newer than this page`);let l=a.rule,c=U=>Wn(t,8+i,s[U],`${e}: ${U}`),u=(U,G,ie,se)=>{let Ns=typeof U=="number"&&U>=G&&U<=ie;return r(Ns,`damaged model (${se} is not a number from ${G} to ${ie})`),U},h=(U,G,ie,se)=>(r(Number.isInteger(U),`damaged model (${se} is not a whole number)`),u(U,G,ie,se)),f=h(l.channels,4,Ne.channels,"channels"),d=h(l.hidden,1,Ne.hidden,"hidden"),m=a.conditioning??Object.entries(qr).map(([U,G])=>[U,G]);r(Array.isArray(m),"damaged model");let{columns:p,fields:g,width:S}=Nn(m,l,e),E=l.transport??!1;r(typeof E=="boolean","damaged model (transport is not true or false)");let v=ct(c("hidden"),d,5*f+S,`${e}: hidden`),T=ct(c("bias"),d,1,`${e}: bias`),M=ct(c("output"),f,d,`${e}: output`),{density:B,velocity:z,gamma:V}=a.scales;for(let U of[B,z,V])u(U,1e-30,1e30,"scale");return{name:e,title:String(a.training?.title??a.training?.style??""),channels:f,hidden:v,bias:T,output:M,decoder:Vn(s,c,f,e),probability:u(l.update_probability,1e-9,1,"update_probability"),steps:h(l.steps_per_frame,1,Ne.steps,"steps_per_frame"),transport:E,dilation:h(l.dilation??l.reach??1,0,Ne.dilation,"dilation"),wholeBox:l.domain==="box",sobel:u(l.sobel_divisor,1e-9,1e9,"sobel_divisor"),laplacian:u(l.laplacian_divisor,1e-9,1e9,"laplacian_divisor"),columns:p,width:S,fields:g,density:B,speed:z,gamma:V,place:Gn(a.place,e)}}function Nn(t,e,r){let i={},s=[],n=0;for(let[a,l,c]of t){let u=typeof a=="string"&&/^\w{1,100}$/.test(a),h=u?a:"something";if(u&&c===void 0&&qr[a]===l)e[`${a}_prior`]!==!1&&(i[a]=n);else{let f=u&&!(a in qr)&&Number.isFinite(c)&&c!==0;L(f,`${r}: the rule is conditioned on ${h}, which this page does not have`);let d=Number.isInteger(l)&&l>=1&&l<=Ne.width;L(d,`${r}: damaged model (width of ${h})`),s.push({name:a,width:l,scale:c,column:n})}n+=l}return{columns:i,fields:s,width:n}}function os(t,e){try{return JSON.parse(t)}catch{throw new P(`${e}: not a model of vnca`)}}function Wn(t,e,r,i){L(r!==void 0,`${i} is missing`),L(r.dtype==="F32",`${i}: expected F32, got ${String(r.dtype)}`);let[s,n=1]=r.shape,[a,l]=r.data_offsets,c=l-a===4*s*n&&a>=0&&e+l<=t.byteLength;L(c&&r.shape.length<=2,`${i}: its place in the file cannot be`);let u=new Float32Array(t.slice(e+a,e+l));return L(u.every(Number.isFinite),`${i}: not all finite`),{values:u,rows:s,columns:n}}function ct(t,e,r,i){let s=t.rows===e&&t.columns===r;return L(s,`${i}: expected ${e} × ${r}, got ${t.rows} × ${t.columns}`),t}function Vn(t,e,r,i){if(t["decoder.first"]===void 0)return[];let n=e("decoder.first").rows;return L(n>=1&&n<=Ne.units,`${i}: a decoder of ${n} units`),$n.map((a,l)=>{let c=a==="output"?4:n,u=`${i}: decoder.${a}`;return{weights:ct(e(`decoder.${a}`),c,l===0?r:n,u),bias:ct(e(`decoder.${a}_bias`),c,1,`${u}_bias`)}})}function Gn(t,e){if(t==null)return null;let{lattice_to_world:r,box:i}=t;return L(wt(r)&&bt(i),`${e}: its place cannot be`),{toWorld:r,lower:i[0],upper:i[1]}}var Fn="vncasmk1",On=65536,Dn=2**24,Hn=1e5,jn=2**20,qn=1100,Kn=16,Yn=64*2**20,Ot=class t{constructor(e,r,i,s,n,a,l,c,u,h,f){this.url=e;this.name=r;this.fps=i;this.lower=s;this.upper=n;this.toWorld=a;this.density=l;this.speed=c;this.fields=u;this.stored=h;this.begin=f}url;name;fps;lower;upper;toWorld;density;speed;fields;stored;begin;frames=new Map;whole=null;get length(){return this.stored.length}get bytesOfBrick(){let e=this.fields.reduce((r,{width:i})=>r+i,0);return 512*(this.speed>0?4:1)+1024*e}number(e){return this.stored[e].number}static async open(e){let r=e.split("/").pop()??e,{bytes:i,isWhole:s}=await Kr(e,0,On);L(i.length>=12,`${r}: not a sequence of vnca`);let n=String.fromCharCode(...i.subarray(0,8));L(n===Fn,`${r}: not a sequence of vnca`);let a=new DataView(i.buffer,i.byteOffset).getUint32(8,!0);L(a<=Dn,`${r}: its header is damaged`),i.length<12+a&&!s&&({bytes:i,isWhole:s}=await Kr(e,0,12+a)),L(i.length>=12+a,`${r}: it ends within its header`);let l;try{let c=new TextDecoder().decode(i.subarray(12,12+a));l=t.described(e,r,JSON.parse(c),12+a)}catch(c){throw c instanceof P?c:new P(`${r}: its header is damaged`)}return s&&(l.whole=i),l}static described(e,r,i,s){let n=(E,v)=>L(E,`${r}: its header is damaged (${v})`);n(bt(i.box),"box");let[a,l]=i.box,{density:c,speed:u,fps:h}=i;n(c>0&&c<1e30&&u>=0&&u<1e30,"scales"),n(h>0&&h<=1e3,"fps");let f=i.lattice_to_world;n(wt(f),"lattice_to_world");let d=i.fields??[];n(Array.isArray(d)&&d.length<=Kn,"fields");for(let{name:E,width:v,scale:T}of d){let M=Number.isInteger(v)&&v>=1&&v<=16;n(typeof E=="string"&&M&&T>=0&&T<1e30,"fields")}let m=i.frames;n(Array.isArray(m)&&m.length>=1&&m.length<=Hn,"frames");let p=a.reduce((E,v,T)=>E*(Math.floor((l[T]-1)/8)-Math.floor(v/8)+1),1);for(let{number:E,offset:v,length:T,bricks:M}of m){let B=[v,T,M].every(V=>Number.isSafeInteger(V)&&V>=0),z=M<=Math.min(p,jn);n(B&&Number.isSafeInteger(E)&&z,"frames")}let g=String(i.name??r).slice(0,100),S=[a,l];return new t(e,g,h,...S,f,c,u,d,m,s)}frame(e){let r=this.frames.get(e);return r===void 0&&(r=this.read(this.stored[e]),this.frames.set(e,r),r.catch(()=>this.frames.delete(e)),this.forget()),r}forget(){let e=0;for(let r of[...this.frames.keys()].reverse())e+=this.stored[r].bricks*this.bytesOfBrick,e>Yn&&this.frames.delete(r)}async read(e){let{number:r,offset:i,length:s,bricks:n}=e,a=`${this.name}, frame ${r}`,l;if(this.whole===null){let{bytes:p,isWhole:g}=await Kr(this.url,this.begin+i,s);g&&(this.whole=p),l=g?p.subarray(this.begin+i,this.begin+i+s):p}else l=this.whole.subarray(this.begin+i,this.begin+i+s);L(l.length===s,`${a}: the file ends before it`);let c=n*(6+this.bytesOfBrick);L(c<=qn*Math.max(s,1),`${a}: less than it says`);let u=await Xn(l,c,a),h=this.lower.map(p=>Math.floor(p/8)),f=this.upper.map(p=>Math.floor((p-1)/8)),d=new DataView(u.buffer),m=new Int32Array(3*n);for(let p=0;p<m.length;p++)m[p]=d.getUint16(2*p,!0)+h[p%3],L(m[p]<=f[p%3],`${a}: a brick lies outside the box`);return{number:r,count:n,bricks:m,planes:u.slice(6*n)}}};async function Kr(t,e,r){let i=`bytes=${e}-${e+Math.max(r,1)-1}`,s=await fetch(t,{headers:{Range:i}});if(s.status!==206&&s.status!==200)throw new P(`${t.split("/").pop()}: the server says ${s.status}`);return{bytes:new Uint8Array(await s.arrayBuffer()),isWhole:s.status===200}}async function Xn(t,e,r){let i=new Uint8Array(e),n=new Blob([t]).stream().pipeThrough(new DecompressionStream("deflate")).getReader(),a=0;try{for(;;){let{done:l,value:c}=await n.read();if(l)break;L(a+c.length<=e,`${r}: more than it says`),i.set(c,a),a+=c.length}}catch(l){throw n.cancel().catch(()=>{}),l instanceof P?l:new P(`${r}: damaged`)}return L(a===e,`${r}: less than it says`),i}var ls=`// How much more of the second rule is seen: \`brushed_at\` reads it and \`set_brushed\` writes it.

@compute @workgroup_size(4, 4, 4)
fn blend(@builtin(global_invocation_id) thread: vec3u) {
  let side = smoke.upper - smoke.lower;
  let at = vec3i(thread);
  if (any(at >= side) || !is_near(at + smoke.lower)) {
    return;
  }
  let row = u32(at.x);
  let place = u32(at.y * side.z + at.z);
  set_brushed(row, place, clamp(brushed_at(row, place) + brush.amount, -1.0, 1.0));
}
`;var ut=`// The smoke that a finger points at, and what is near it.

struct Brush {
  eye: vec4f,       // Of the ray, in cells; w: the radius, cells.
  way: vec4f,       // A unit vector; w: γ of a cell of density 1.
  size: vec4f,      // Of what is drawn, in its cells; w: parts of a cell.
  amount: f32,      // What is added to the mix of rules.
}

@group(1) @binding(0) var<uniform> brush: Brush;
@group(1) @binding(2) var<storage, read_write> hit: vec4f;           // The cell met; w: 1 if any.

fn is_near(cell: vec3i) -> bool {
  return hit.w > 0.0 && distance(vec3f(cell), hit.xyz + vec3f(smoke.lower)) <= brush.eye.w;
}
`;var cs=`// Where a ray meets the smoke.

@group(1) @binding(1) var drawn: texture_3d<f32>;

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
`;var us=`// The smoke of a frame as its file has it: bytes of bricks, made into numbers where they are read.

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

// \`word_at\` reads the map, the number of a brick or NONE; then the densities, 128 words a brick; then
// the velocities; then the fields, 256 words a brick and component.
@group(2) @binding(0) var<uniform> smoke: Smoke;

const NONE = 0xffffffffu;

// Where a cell stands among those of all bricks, or NONE.
fn stored_at(cell: vec3i) -> u32 {
  let at = (cell >> vec3u(3)) - smoke.first;
  if (any(at < vec3i(0)) || any(at >= smoke.span)) {
    return NONE;
  }
  let brick = word_at(u32((at.x * smoke.span.y + at.y) * smoke.span.z + at.z));
  let within = vec3u(cell & vec3i(7));
  return select(512u * brick + ((within.x << 6) | (within.y << 3) | within.z), NONE, brick == NONE);
}

fn byte_of(plane: u32, stored: u32) -> u32 {
  let map = u32(smoke.span.x * smoke.span.y * smoke.span.z);
  let word = word_at(map + 128u * plane * smoke.bricks + stored / 4u);
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

// A component of the fields, −1 … 1.
fn field_at(component: u32, cell: vec3i) -> f32 {
  let stored = stored_at(cell);
  if (stored == NONE) {
    return 0.0;
  }
  let planes = select(1u, 4u, smoke.speed > 0.0);
  let before = u32(smoke.span.x * smoke.span.y * smoke.span.z) + 128u * planes * smoke.bricks;
  let word = word_at(before + 256u * component * smoke.bricks + stored / 2u);
  return f32(i32(word << (16u * (1u - (stored & 1u)))) >> 16u) / 32767.0;
}

// A velocity turned towards a direction by a part; one that rests, as if it had half of \`unit\`.
fn guided(velocity: vec3f, guide: vec4f, unit: f32) -> vec3f {
  return mix(velocity, guide.xyz * max(length(velocity), 0.5 * unit), guide.w);
}
`;var W=class t{constructor(e,r,i){this.count=e;this.width=r;this.each=i}count;width;each;static of(e,r,i,s=0){return new t(r,i,Math.max(Math.floor(e.bindable/Math.max(i,s)),1))}static WHOLE=new t(1,4,1);get parts(){return Math.max(Math.ceil(this.count/this.each),1)}declared(e,{group:r,first:i,element:s,width:n,isWritten:a=!1}){let{parts:l,each:c}=this,u=l===1?"row":`row % ${c}u`,h=n===void 0?u:`(${u}) * ${n} + place`,f=n===void 0?"row: u32":"row: u32, place: u32",d=a?"read_write":"read",m=Array.from({length:l},(T,M)=>`${`@group(${r}) @binding(${i+M})`} var<storage, ${d}> ${e}_${M}: array<${s}>;
`),p=T=>Array.from({length:l},(M,B)=>l-1-B).map(M=>`${M>0?`if (row >= ${M*c}u) `:""}{ ${T(`${e}_${M}[at]`)} }
`).join("  "),g=`{
  let at = ${h};
  `,S=`fn ${e}_at(${f}) -> ${s} ${g}${p(T=>`return ${T};`)}}
`,v=`${`fn set_${e}(${f}, value: ${s}) ${g}`}${p(T=>`${T} = value; return;`)}}
`;return`${m.join("")}${S}${a?v:""}`}},j=class t{constructor(e,r,i){this.gpu=e;this.layout=r;this.buffers=i}gpu;layout;buffers;static empty(e,r,i){let{count:s,each:n,width:a,parts:l}=r;e.requireBindings(l,i);let c=at(a);L(a<=e.bindable,`${i}: a row of ${c} is more than this GPU binds at once.`);let u=Array.from({length:l},(h,f)=>e.buffer(Math.min(n,s-f*n)*a));return new t(e,r,u)}static of(e,r,i){let s=t.empty(e,W.of(e,r.length,4),i),{each:n}=s.layout;return s.buffers.forEach((a,l)=>e.write(a,r.subarray(l*n,(l+1)*n))),s}bindings(e){return Object.fromEntries(this.buffers.map((r,i)=>[e+i,r]))}clear(){this.gpu.submit(e=>this.buffers.forEach(r=>e.clearBuffer(r)))}async read(){let{count:e,each:r,width:i}=this.layout,s=new Uint8Array(e*i);for(let[n,a]of this.buffers.entries()){let l=Math.min(r,e-n*r)*i;s.set(new Uint8Array(await this.gpu.read(a,l)),n*r*i)}return s.buffer}destroy(){for(let e of this.buffers)e.destroy()}};var hs=`// Where cells lie: rows of the state by index coordinates, through a map of bricks of 8³ cells.
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

// What a thread works on: so many rows from the first on.
struct Batch {
  first: u32,
  rows: u32,
}

// Rows from \`cells\` on belong to cells beside the active ones, which have a place and no state.
//
// \`place_at\` reads, behind each other: the map, a number of a brick or NOWHERE for each of its places, z fastest; the
// coordinates of the bricks, three each; the rows of their cells, 512 each; and where the cell of
// each row lies, number of brick · 512 + place in it.
@group(0) @binding(0) var<uniform> sites: Sites;
@group(0) @binding(1) var<uniform> batch: Batch;

fn map_length() -> u32 {
  return u32(sites.span.x * sites.span.y * sites.span.z);
}

// The number of the brick that holds a cell, or NOWHERE.
fn brick_at(cell: vec3i) -> u32 {
  let at = (cell >> vec3u(3)) - sites.first;
  if (any(at < vec3i(0)) || any(at >= sites.span)) {
    return NOWHERE;
  }
  return place_at(u32((at.x * sites.span.y + at.y) * sites.span.z + at.z));
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
  return place_at(map_length() + 3u * sites.bricks + 512u * brick + place_in_brick(cell));
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
  let at = place_at(map_length() + 515u * sites.bricks + row);
  let brick = map_length() + 3u * (at >> 9);
  let corner = vec3i(vec3u(place_at(brick), place_at(brick + 1u), place_at(brick + 2u)));
  return corner * 8 + vec3i(vec3u((at >> 6) & 7u, (at >> 3) & 7u, at & 7u));
}
`;var Dt=4294967295,ra=.01,ye={group:0,first:16,element:"u32"},Ht=3;function ue(t){return`${t.declared("place",ye)}${hs}`}var Yr=class{constructor(e,r){this.lower=e;this.upper=r;this.size=[0,1,2].map(i=>r[i]-e[i]),this.values=new Uint8Array(this.size[0]*this.size[1]*this.size[2])}lower;upper;size;values;at(e,r,i){let[s,n,a]=this.lower;return((e-s)*this.size[1]+(r-n))*this.size[2]+(i-a)}holds(e,r,i){let{lower:s,upper:n}=this;return e>=s[0]&&e<n[0]&&r>=s[1]&&r<n[1]&&i>=s[2]&&i<n[2]}spread(e,r){let{size:i,values:s}=this,n=[i[1]*i[2],i[2],1],a=Uint8Array.from(s,l=>l>0?1:0);for(let l=0;l<3;l++){let c=n[l],u=i[l],h=a.slice();for(let f=0;f<h.length;f++){if(h[f]===0)continue;let d=Math.floor(f/c)%u,m=-Math.min(e,d),p=Math.min(e,u-1-d);for(let g=m;g<=p;g++)a[f+g*c]=1}}for(let l=0;l<s.length;l++)s[l]===0&&a[l]===1&&(s[l]=r)}};function ds(t,e,r,i,s){let n=t.lower.map(c=>c-i),a=t.upper.map(c=>c+i),l=new Yr(n,a);return s?l.values.fill(1):(ia(l,t,e,255*Math.sqrt(ra*r/t.density)),l.spread(i,1),l.spread(Ht,2)),sa(l,t)}function ia(t,e,r,i){for(let s=0;s<r.count;s++){let[n,a,l]=[0,1,2].map(c=>8*r.bricks[3*s+c]);for(let c=0;c<512;c++){if(r.planes[512*s+c]<=i)continue;let[u,h,f]=[n+(c>>6),a+(c>>3&7),l+(c&7)];u>=e.lower[0]&&u<e.upper[0]&&h>=e.lower[1]&&h<e.upper[1]&&f>=e.lower[2]&&f<e.upper[2]&&(t.values[t.at(u,h,f)]=1)}}}function sa(t,e){let r=t.lower.map(p=>Math.floor(p/8)),i=t.upper.map((p,g)=>Math.floor((p-1)/8)+1-r[g]),s=new Uint32Array(i[0]*i[1]*i[2]).fill(Dt),n=[],a=[],l=[],c=[],u=0;for(let p=0;p<i[0];p++)for(let g=0;g<i[1];g++)for(let S=0;S<i[2];S++,u++){let E=[8*(p+r[0]),8*(g+r[1]),8*(S+r[2])];na(t,e,E,a.length,l,c)&&(s[u]=a.length,a.push(u),n.push(p+r[0],g+r[1],S+r[2]))}let h=a.length,f=s.length+3*h,d=new Uint32Array(f+512*h+l.length+c.length);d.set(s),d.set(Int32Array.from(n),s.length),d.fill(Dt,f,f+512*h),[l,c].flat().forEach((p,g)=>{d[f+p]=g,d[f+512*h+g]=p});let m=new Int32Array(16);return m.set([...t.lower,l.length,...t.upper,0,...r,h,...i,0]),{cells:l.length,beside:c.length,uniform:m,places:d}}function na(t,e,[r,i,s],n,a,l){let c=a.length+l.length;for(let u=0;u<512;u++){let[h,f,d]=[r+(u>>6),i+(u>>3&7),s+(u&7)];if(!t.holds(h,f,d))continue;let m=t.values[t.at(h,f,d)];m===1?a.push(512*n+u):m===2&&h>=e.lower[0]&&h<e.upper[0]&&f>=e.lower[1]&&f<e.upper[1]&&d>=e.lower[2]&&d<e.upper[2]&&l.push(512*n+u)}return a.length+l.length>c}var fs={group:2,first:16,element:"u32"};function Q(t){return`${t.declared("word",fs)}${us}`}var jt=class t{constructor(e,r,i){this.frame=e;this.uniform=r;this.words=i}frame;uniform;words;static upload(e,r,i){let s=r.lower.map(d=>Math.floor(d/8)),n=r.upper.map((d,m)=>Math.floor((d-1)/8)+1-s[m]),a=n[0]*n[1]*n[2],l=new Uint32Array(a+i.planes.length/4);l.fill(Dt,0,a);for(let d=0;d<i.count;d++){let[m,p,g]=[0,1,2].map(S=>i.bricks[3*d+S]-s[S]);l[(m*n[1]+p)*n[2]+g]=d}new Uint8Array(l.buffer).set(i.planes,4*a);let c=new ArrayBuffer(64),u=new Int32Array(c),h=new Float32Array(c);u.set(r.lower),h[3]=r.density,u.set(r.upper,4),h[7]=r.speed,u.set([...s,i.count,...n],8);let f=e.uniform(64);return e.write(f,new Uint8Array(c)),new t(i,f,j.of(e,l,"the smoke"))}bindings(e=!0){return{0:this.uniform,...e?this.words.bindings(fs.first):{}}}destroy(){this.uniform.destroy(),this.words.destroy()}};var ms=`// Emission and absorption along the rays of a camera, as \`rendering/\` adds them up: samples lie at
// whole multiples of a step from the eye, and colour is the quotient of what is interpolated.

struct Camera {
  eye: vec4f,        // In cells of what is drawn; w: their number in a cell of the smoke.
  middle: vec4f,     // The direction of the picture's middle, for a length of depth; w: the step.
  right: vec4f,      // What is added to it for a picture's height to the right; w: aspect,
  up: vec4f,         // and for one up; w: γ times the step.
  size: vec4f,       // Of what is drawn, in cells; w: how much of the picture, from the left.
  blocks: vec4f,     // The first block of the light, in cells; w: cells along an edge of a block.
  light: vec4f,      // What a colour is multiplied by without shadow; 1 where there is a light.
}

// Where a file has no brick there is no smoke within a cell (\`viewer/smoke_file.py\`): rays leap.

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var drawn: texture_3d<f32>;
@group(0) @binding(2) var shadow: texture_3d<f32>;
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
  let size = vec3f(textureDimensions(shadow));
  let at = (cell - camera.blocks.xyz) / camera.blocks.w;
  return camera.light.x - textureSampleLevel(shadow, between, (at + 0.5) / size, 0.0).x;
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
  return word_at(u32((at.x * smoke.span.y + at.y) * smoke.span.z + at.z)) != NONE;
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
    if (camera.light.y > 0.0) {
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
`;var ps=`// What is drawn: density, and colour times density, at every cell of the box and one beside it.
//
// \`painted_at\` reads what a rule has painted, \`brushed_at\` how much more of it is seen at a cell.

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
        let part = u32((inside.x * look.parts + inside.y) * look.parts + inside.z);
        colour = painted_at(row, part);
        colour.w = select(1.0, colour.w, row < sites.cells);
      }
      let shown = 1.0 + look.strength * (colour.xyz - 1.0);
      let thick = density * (1.0 + look.density_strength * (colour.w - 1.0));
      value = vec4f(shown * thick, thick);
    }
    if (look.has_under == 1u) {
      let at = coarse - smoke.lower;
      let side = smoke.upper - smoke.lower;
      let more = brushed_at(u32(at.x), u32(at.y * side.z + at.z));
      value = mix(textureLoad(under, thread, 0), value, clamp(look.mixed + more, 0.0, 1.0));
    }
  }
  textureStore(drawn, thread, value);
}
`;var Xr=`// How much light reaches each place, as \`rendering/light.py\` finds it: how much smoke lies between it
// and the light, and each part of the sky, layer by layer away from them, of means over blocks of
// cells. All ways are swept at once.

struct Light {
  first: vec3i,     // The lowest block: blocks hold the cells from block · times on.
  times: i32,       // Cells along an edge of a block.
  size: vec3i,      // How many blocks there are along each axis.
  layer: i32,
  origin: vec3i,    // Index coordinates of the first cell of what is drawn, the cell beside the box.
  strength: f32,
  facing: vec2f,    // How bright smoke is that faces the light, and a sky.
  parts: vec2f,     // Of the strength: that of the light, and that of the sky.
  octaves: vec4f,   // Two weights, and two parts of the extinction.
}

// Where light comes from: first the light, then the parts of the sky.
struct Way {
  shift: vec2f,     // Blocks along the two other axes that light comes from, a layer before.
  half: f32,        // Half the way through a block along the ray, times γ.
  main: u32,        // The axis that layers follow,
  weight: f32,
  is_up: u32,       // and 1 where the light stands where that axis leads to.
}

@group(0) @binding(0) var<uniform> light: Light;
@group(0) @binding(1) var drawn: texture_3d<f32>;
@group(0) @binding(2) var<storage, read_write> thickness: array<f32>;
@group(0) @binding(3) var<storage, read_write> depth: array<f32>;
@group(0) @binding(4) var shadow: texture_storage_3d<rgba16float, write>;
@group(0) @binding(5) var<storage, read> ways: array<Way>;

fn number(block: vec3i) -> u32 {
  return u32((block.x * light.size.y + block.y) * light.size.z + block.z);
}

fn number_of(way: u32, block: vec3i) -> u32 {
  return way * u32(light.size.x * light.size.y * light.size.z) + number(block);
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
  thickness[number(block)] = sum / f32(light.times * light.times * light.times);
}

// A block of a layer by its place there; outside it is nothing.
fn block_of(way: u32, layer: i32, place: vec2i) -> vec3i {
  let main = ways[way].main;
  let along = select(layer, light.size[main] - 1 - layer, ways[way].is_up == 1u);
  switch (main) {
    case 0u: { return vec3i(along, place.x, place.y); }
    case 1u: { return vec3i(place.x, along, place.y); }
    default: { return vec3i(place.x, place.y, along); }
  }
}

fn behind(way: u32, layer: i32, place: vec2i) -> f32 {
  let block = block_of(way, layer, place);
  if (any(block < vec3i(0)) || any(block >= light.size)) {
    return 0.0;
  }
  return depth[number_of(way, block)] + ways[way].half * thickness[number(block)];
}

@compute @workgroup_size(8, 8)
fn sweep(@builtin(global_invocation_id) thread: vec3u) {
  let place = vec2i(thread.xy);
  let way = thread.z;
  let block = block_of(way, light.layer, place);
  if (any(block < vec3i(0)) || any(block >= light.size)) {
    return;
  }
  var value = 0.0;
  if (light.layer > 0) {
    let shift = ways[way].shift;
    let low = floor(shift);
    let part = shift - low;
    let at = place + vec2i(low);
    let before = light.layer - 1;
    let first = mix(behind(way, before, at), behind(way, before, at + vec2i(1, 0)), part.x);
    let second = mix(behind(way, before, at + vec2i(0, 1)), behind(way, before, at + vec2i(1, 1)), part.x);
    value = mix(first, second, part.y) + ways[way].half * thickness[number(block)];
  }
  depth[number_of(way, block)] = value;
}

fn passed(way: u32, block: vec3i) -> f32 {
  let reached = exp(-depth[number_of(way, block)] * light.octaves.zw);
  return ways[way].weight * dot(light.octaves.xy, reached);
}

@compute @workgroup_size(4, 4, 4)
fn shade(@builtin(global_invocation_id) thread: vec3u) {
  let block = vec3i(thread);
  if (any(block >= light.size)) {
    return;
  }
  var sky = 0.0;
  for (var way = 1u; way < arrayLength(&ways); way++) {
    sky += passed(way, block);
  }
  let taken = max(1.0 - vec2f(passed(0u, block), sky) / light.facing, vec2f(0.0));
  textureStore(shadow, block, vec4f(light.strength * dot(light.parts, taken), 0.0, 0.0, 0.0));
}
`;var ca=96,Qr=[[.8,1],[.2,1/4]],ua=Qr.reduce((t,[e,r])=>t+e/(1+r),0),ha=Qr.reduce((t,[e,r])=>t+e/2*(1-r*Math.log(1+1/r)),0),qt=da().map(t=>{let e=t.filter(r=>r!==0).length;return{weight:e===1?1/15:3/40,way:C(t,1/Math.sqrt(e))}}),ht=256,We=24;function gs({strength:t}){return Math.max(1,t)}var dt=class{constructor(e,r,i){this.gpu=e;this.smoke=r;this.parts=i;let[s,n]=es(r,i),a=Math.max(...s.map((u,h)=>n[h]-u))/ca;this.times=Math.max(Math.round(a),1),this.first=r.lower.map(u=>Math.floor(u*i/this.times)-1);let l=r.upper.map(u=>Math.floor((u*i-1)/this.times)+1);this.size=this.first.map((u,h)=>l[h]-u+1);let c=this.size.reduce((u,h)=>u*h,1);this.shadow=ot(e,this.size),this.thickness=e.buffer(4*c),this.depth=e.buffer(4*c*(1+qt.length)),this.ways=e.buffer(We*(1+qt.length)),this.slots=e.uniform(ht*Math.max(...this.size))}gpu;smoke;parts;shadow;times;first;size;slots;ways;thickness;depth;static prepared(){return["gather","sweep","shade"].map(e=>[Xr,e])}get middle(){let{smoke:e,parts:r,times:i}=this;return this.first.map((s,n)=>(s+.5)*i-.5-e.lower[n]*r+1)}cast(e,r,i){let{gpu:s,size:n}=this,a=Math.max(...n);this.write(r,i,a);let l=S=>({buffer:this.slots,offset:ht*S,size:80}),[c,u,h]=["gather","sweep","shade"].map(S=>s.compute(Xr,S)),[f,d]=[Gt(n),Math.ceil(a/8)],{thickness:m,depth:p,ways:g}=this;s.submit(S=>{let E={0:l(0),1:e.createView(),2:m};N(S,c,[s.bound(c,0,E)],f);for(let T=0;T<a;T++){let M={0:l(T),2:m,3:p,5:g};N(S,u,[s.bound(u,0,M)],[d,d,1+qt.length])}let v={0:l(0),3:p,4:this.shadow.createView(),5:g};N(S,h,[s.bound(h,0,v)],f)})}write({azimuth:e,elevation:r,strength:i,ambient:s},n,a){let{gpu:l,smoke:c,parts:u,times:h,first:f,size:d}=this,[,,m]=H(e,r),p=[{weight:1,way:C(m,-1)},...qt],g=new ArrayBuffer(We*p.length);p.forEach(({weight:v,way:T},M)=>{let B=C(Ie(c,T),1/h),z=B.map(Math.abs),V=z.indexOf(Math.max(...z)),U=[0,1,2].filter(se=>se!==V),G=.5/z[V]*n/u,ie=U.map(se=>B[se]/z[V]);new Float32Array(g,We*M,3).set([...ie,G]),new Uint32Array(g,We*M+12,1)[0]=V,new Float32Array(g,We*M+16,1)[0]=v,new Uint32Array(g,We*M+20,1)[0]=B[V]>0?1:0}),l.write(this.ways,new Uint8Array(g));let S=c.lower.map(v=>v*u-1),E=new ArrayBuffer(ht*a);for(let v=0;v<a;v++)new Int32Array(E,ht*v,11).set([...f,h,...d,v,...S]),new Float32Array(E,ht*v+44,9).set([i,ua,ha,1-s,s,...[0,1].flatMap(T=>Qr.map(M=>M[T]))]);l.write(this.slots,new Uint8Array(E))}destroy(){for(let e of[this.shadow,this.thickness,this.depth,this.ways,this.slots])e.destroy()}};function da(){let t=[-1,0,1];return t.flatMap(e=>t.flatMap(r=>t.map(i=>[e,r,i]))).filter(([e,r,i])=>(e+r+i)%2!==0)}var Kt="rgba16float",ys={group:1,first:16,element:"vec4f",width:"u32(look.parts * look.parts * look.parts)"},mt={group:1,first:512,element:"f32",width:"u32((smoke.upper.y - smoke.lower.y) * (smoke.upper.z - smoke.lower.z))"};function ws(t,e,r,i){let s=`${e.declared("painted",ys)}${r.declared("brushed",mt)}`;return`${ue(t)}${Q(i)}${s}${ps}`}function bs(t){return`${Q(t)}${ms}`}var ft=class t{constructor(e,r){this.gpu=e;this.smoke=r;this.looks=[0,1].map(()=>e.uniform(32)),this.camera=e.uniform(112),this.sampler=e.device.createSampler({magFilter:"linear",minFilter:"linear"}),this.nothing=ot(e,[1,1,1])}gpu;smoke;parts=0;size=[];textures=[];buffers=null;drawn=null;shadows=null;looks;camera;sampler;nothing;static async create(e,r){let{WHOLE:i}=W;return await Promise.all([e.prepare([[ws(i,i,i,i),"volume"],...dt.prepared()]),e.prepareRender(bs(i),"march",Kt)]),new t(e,r)}refine(e){e!==this.parts&&(this.release(),this.size=Wt(this.gpu,this.smoke,e),this.parts=e,this.textures=[0,1].map(()=>ot(this.gpu,this.size)),this.shadows=new dt(this.gpu,this.smoke,e))}draw(e,r,i,s){this.buffers=e;let n=this.nothing;r.forEach((a,l)=>{let c=new ArrayBuffer(32),u=s.isPlain?1:0;new Int32Array(c).set([this.parts,u,l>0?1:0]);let{mixed:h,strength:f,densityStrength:d}=s,m=s.isPlain?0:d;new Float32Array(c).set([h,f,m,a.rule.density],3),this.gpu.write(this.looks[l],new Uint8Array(c)),n=this.drawLayer(e,a,l,i,n)}),this.drawn=n,s.light.strength>0&&this.shadows.cast(this.drawn,s.light,s.gamma)}drawLayer(e,r,i,s,n){let{gpu:a}=this,l=this.textures[i],[c,u]=[r.places,r.painted],h=[c,u,s,e.words];a.requireBindings(h.reduce((p,{layout:g})=>p+g.parts,0),"the picture");let f=ws(c.layout,u.layout,s.layout,e.words.layout),d=a.compute(f,"volume"),m=[a.bound(d,0,{0:r.uniform,...c.bindings(ye.first)}),a.bound(d,1,{0:this.looks[i],3:n.createView(),4:l.createView(),...u.bindings(ys.first),...s.bindings(mt.first)}),a.bound(d,2,e.bindings())];return a.submit(p=>N(p,d,m,Gt(this.size))),l}take(e,r,i,s,n,[a,l]=[0,1],c=!0){let{gpu:u,parts:h}=this,f=r.width/r.height,d=2*Z(i.fieldOfView),[m,p,g]=H(i.azimuth,i.elevation),S=ie=>Ie(this.smoke,ie),{light:E}=s,v=this.shadows,T=new Float32Array([...this.place(yt(i)),h,...S(g),n,...S(C(m,d)),f,...S(C(p,d)),s.gamma/h*n,...this.size,0,...v.middle,v.times,gs(E),E.strength>0?1:0,0,0]);u.write(this.camera,T);let M=this.buffers,B=u.render(bs(M.words.layout),"march",Kt),z=e.beginRenderPass({colorAttachments:[{view:r.createView(),loadOp:c?"clear":"load",storeOp:"store",clearValue:[0,0,0,0]}]});z.setPipeline(B);let V=u.bound(B,0,{0:this.camera,1:this.drawn.createView(),2:v.shadow.createView(),3:this.sampler});z.setBindGroup(0,V),z.setBindGroup(1,u.bound(B,1,{})),z.setBindGroup(2,u.bound(B,2,M.bindings()));let U=Math.round(a*r.width),G=Math.round(l*r.width)-U;G>0&&(z.setScissorRect(U,0,G,r.height),z.draw(3)),z.end()}place(e){return gt(ne(this.smoke.toWorld),e).map((i,s)=>(i+.5)*this.parts-.5-this.smoke.lower[s]*this.parts+1)}get texture3d(){return this.drawn}get cells(){return this.size}get refinement(){return this.parts}release(){for(let e of this.textures)e.destroy();this.shadows?.destroy()}destroy(){this.release();for(let e of[this.camera,this.nothing,...this.looks])e.destroy()}};var vs=.5;function ks(){return`${Q(W.WHOLE)}${ut}${cs}`}function xs(t){let e=t.declared("brushed",{...mt,isWritten:!0});return`${Q(W.WHOLE)}${ut}${e}${ls}`}var Yt=class t{constructor(e,r){this.gpu=e;this.smoke=r;let[i,s,n]=r.lower.map((a,l)=>r.upper[l]-a);this.brushed=j.empty(e,W.of(e,i,4*s*n),"the mix of two rules"),this.uniform=e.uniform(64),this.hit=e.buffer(16)}gpu;smoke;brushed;uniform;hit;static async create(e,r){let i=new t(e,r);return await e.prepare([[ks(),"meet"],[xs(i.brushed.layout),"blend"]]),i}point([e,r],{camera:i,aspect:s,picture:n,gamma:a},l,c){let{gpu:u,smoke:h}=this,[f,d,m]=H(i.azimuth,i.elevation),p=2*Z(i.fieldOfView),g=I(I(m,f,e*s*p),d,r*p),S=Ie(h,C(g,1/Math.hypot(...g))),E=n.refinement,v=l==="less"?-vs:vs;u.write(this.uniform,new Float32Array([...n.place(yt(i)),c,...S,a/E,...n.cells,E,v,0,0,0]));let T=u.compute(ks(),"meet"),M={0:this.uniform,1:n.texture3d.createView(),2:this.hit},B=[u.bound(T,0,{}),u.bound(T,1,M)];u.submit(z=>N(z,T,B,1))}erase(e,r){for(let i of e)i.erase(r,{0:this.uniform,2:this.hit})}blend(e){let{gpu:r,smoke:i,brushed:s}=this,n=r.compute(xs(s.layout),"blend"),a=i.lower.map((c,u)=>Math.ceil((i.upper[u]-c)/4)),l=[r.bound(n,0,{}),r.bound(n,1,{0:this.uniform,2:this.hit,...s.bindings(mt.first)}),r.bound(n,2,e.bindings(!1))];r.submit(c=>N(c,n,l,a))}};function D(t){return Math.ceil(t/4)}function Ss(t){let e=t;return e^=e>>>16,e=Math.imul(e,2146121005),e^=e>>>15,e=Math.imul(e,2221713035),e^=e>>>16,e>>>0}function _s(t,e){return Ss((t>>>0)+Ss(e>>>0)>>>0)}function Ts(t){return Math.min(Math.max(Math.round(t*2**32),1),2**32-1)}function Ms(t,e){let r=new Float32Array(216),i=[1,2,1];for(let s=0;s<27;s++){let[n,a,l]=[Math.floor(s/9),Math.floor(s/3)%3,s%3],c=Math.abs(n-1)+Math.abs(a-1)+Math.abs(l-1);r.set([c===0?1:0,(n-1)*i[a]*i[l]/t,(a-1)*i[n]*i[l]/t,(l-1)*i[n]*i[a]/t,[-88,6,3,2][c]/e],8*s)}return r}function Zr(t,e,r){let{channels:i,hidden:s,bias:n,output:a}=t,l=4*D(i),c=5*l+e+l,u=new Float32Array(s.rows*c);for(let h=0;h<s.rows;h++){let f=s.values.subarray(h*s.columns,(h+1)*s.columns),d=h*c;for(let m=0;m<5;m++){let p=f.subarray(m*i,(m+1)*i);u.set(p,d+m*l)}u.set(f.subarray(5*i),d+5*l),u[d+5*l+e-1]=n.values[h];for(let m=0;m<i;m++){let p=d+5*l+e+m;u[p]=a.values[m*a.columns+h]}}return r?fa(u):u}function Jr(t){if(t.decoder.length===0)return new Float32Array(4);let e=4*D(t.decoder[0].weights.rows),r=t.decoder.flatMap(({weights:n,bias:a},l)=>{let c=l<3?e:4;return[Es(n,c,4*D(n.columns)),Es(a,c,1)]}),i=new Float32Array(r.reduce((n,a)=>n+a.length,0)),s=0;for(let n of r)i.set(n,s),s+=n.length;return i}function Es(t,e,r){let i=new Float32Array(e*r);for(let s=0;s<t.rows;s++){let n=t.values.subarray(s*t.columns,(s+1)*t.columns);i.set(n,s*r)}return i}function fa(t){let e=new Uint32Array(t.slice().buffer);return Uint16Array.from(e,r=>{let i=r>>>16&32768,s=r&2147483647;if(s>=1199570944)return i|31744;if(s<855638016)return i;if(s<947912704){let l=126-(s>>>23),c=s&8388607|8388608,u=c>>>l,h=c&(1<<l)-1,f=1<<l-1;return i|u+(h>f||h===f&&u&1?1:0)}let n=s-939524096>>>13,a=s&8191;return i|n+(a>4096||a===4096&&n&1?1:0)})}var As=`// The state on the cells of another frame, carried there by its velocity: \`painting/transport.py\`.
//
// \`sites\` are those that it comes from, and the batch those that want it: \`wanted_place_at\` tells where
// they lie, \`before_at\` what there was. Places are counted from the cell, which keeps their digits.

struct Wanted {
  map: u32,       // Of the cells that want a state: how many places their map has,
  bricks: u32,    // and how many bricks hold them.
  unused: u32,
  frames: f32,    // For how long the velocity carries it; below zero back, 0 not at all.
  guide: vec4f,   // As the rule is told.
  speed: f32,     // That counts as 1.
}

@group(1) @binding(0) var<uniform> wanted: Wanted;
@group(1) @binding(3) var<storage, read_write> after: array<vec4f>;  // Of the batch.

// What must be active upstream of a cell for it to have its state from there.
const LEAST_SHARE = 0.25;
// What must be known of the velocity.
const LEAST_KNOWN = 1e-6;
const FARTHEST = 1048576.0;

fn wanted_cell(row: u32) -> vec3i {
  let at = wanted_place_at(wanted.map + 515u * wanted.bricks + row);
  let brick = wanted.map + 3u * (at >> 9);
  let corner = vec3u(wanted_place_at(brick), wanted_place_at(brick + 1u), wanted_place_at(brick + 2u));
  return vec3i(corner) * 8 + vec3i(vec3u((at >> 6) & 7u, (at >> 3) & 7u, at & 7u));
}

fn side_of(corner: u32) -> vec3i {
  return vec3i(vec3u(corner >> 2, (corner >> 1) & 1u, corner & 1u));
}

fn share_of(side: vec3i, upper: vec3f) -> f32 {
  let parts = select(1.0 - upper, upper, side == vec3i(1));
  return parts.x * parts.y * parts.z;
}

// The shares of four cells along an axis for a place between the two in the middle: Catmull & Rom.
fn cubic(t: f32) -> vec4f {
  return vec4f(
    ((2.0 - t) * t - 1.0) * t, (3.0 * t - 5.0) * t * t + 2.0, ((4.0 - 3.0 * t) * t + 1.0) * t,
    (t - 1.0) * t * t,
  ) / 2.0;
}

// A cell that is not active counts as the next that is.
fn among(shares: vec4f, alive: vec4<bool>) -> vec4f {
  let outer = shares.xw * vec2f(alive.xw & alive.yz);
  let inner = shares.yz + (shares.xw - outer);
  let middle = select(vec2f(0.0), inner + select(inner.yx, vec2f(0.0), alive.zy), alive.yz);
  return vec4f(outer.x, middle, outer.y);
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
  let number = thread.y * groups.x * 64u + thread.x;
  if (number >= batch.rows) {
    return;
  }
  let cell = wanted_cell(batch.first + number);
  let upstream = clamp(-moved(cell), vec3f(-FARTHEST), vec3f(FARTHEST));
  let first = floor(upstream);
  let place = upstream - first;
  var rows: array<u32, 64>;
  var shares: array<f32, 64>;
  var total = 0.0;
  var planes: vec4<bool>;
  for (var i = 0; i < 4; i++) {
    var lines: vec4<bool>;
    for (var j = 0; j < 4; j++) {
      let line = 16 * i + 4 * j;
      var alive: vec4<bool>;
      for (var k = 0; k < 4; k++) {
        let side = vec3i(i, j, k) - 1;
        let row = row_of(bordered(cell + vec3i(first) + side));
        rows[line + k] = row;
        alive[k] = row < sites.cells;
        if (alive[k] && all((side & vec3i(~1)) == vec3i(0))) {
          total += share_of(side, place);
        }
      }
      let along_z = among(cubic(place.z), alive);
      for (var k = 0; k < 4; k++) {
        shares[line + k] = along_z[k];
      }
      lines[j] = alive.y || alive.z;
    }
    let along_y = among(cubic(place.y), lines);
    for (var at = 0; at < 16; at++) {
      shares[16 * i + at] *= along_y[at >> 2u];
    }
    planes[i] = lines.y || lines.z;
  }
  let along_x = among(cubic(place.x), planes);
  for (var at = 0; at < 64; at++) {
    shares[at] *= along_x[at >> 4u];
  }
  if (total < LEAST_SHARE) {
    shares = array<f32, 64>();
    rows[0] = row_of(cell);
    shares[0] = select(0.0, 1.0, rows[0] < sites.cells);
  }
  for (var p = 0u; p < PLANES; p++) {
    var value = vec4f(0.0);
    for (var at = 0; at < 64; at++) {
      if (shares[at] != 0.0) {
        value += shares[at] * before_at(rows[at], p);
      }
    }
    after[number * PLANES + p] = value;
  }
}
`;var Ps=`// What the cells of a rule are conditioned on: position, density, velocity, as \`rule/conditioning.py\`;
// and \`tell_fields\` adds fields of the smoke.

struct Condition {
  place: mat4x4f,   // From index coordinates to −1 … 1 in the box of the training.
  columns: vec3i,   // The first column of position, density and velocity; −1 where there is none.
  width: u32,       // Numbers a cell is told, the 1 included.
  scales: vec2f,    // Density and speed that count as 1.
  unused: vec2f,
  guide: vec4f,     // A direction, in which velocity is turned by a part.
}

@group(1) @binding(0) var<uniform> given: Condition;
@group(1) @binding(1) var<storage, read_write> told: array<f32>;  // Of the batch.

const SPEED_LIMIT = 2.0;
const DENSITY_LIMIT = 4.0;

@compute @workgroup_size(64)
fn condition(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let number = thread.y * groups.x * 64u + thread.x;
  if (number >= batch.rows) {
    return;
  }
  let cell = cell_of(batch.first + number);
  let first = number * given.width;
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
  tell_fields(first, cell);
}
`;var Ls=`// States made zero where a brush touches the smoke; they begin anew.

@group(1) @binding(3) var<storage, read_write> state: array<vec4f>;  // Of the batch.

@compute @workgroup_size(64)
fn erase(
  @builtin(global_invocation_id) thread: vec3u, @builtin(num_workgroups) groups: vec3u
) {
  let number = thread.y * groups.x * 64u + thread.x;
  if (number < batch.rows && is_near(cell_of(batch.first + number))) {
    for (var p = 0u; p < PLANES; p++) {
      state[number * PLANES + p] = vec4f(0.0);
    }
  }
}
`;var Us=`// What is seen of a state: the mean over each part of a cell, as \`painting/__init__.py\` paints it.

struct Paint {
  parts: u32,       // Of a cell along each axis.
  samples: u32,     // Points along each axis of a part.
  layer: u32,       // Of the rim: how far outwards it is.
  cells: u32,       // How many cells are painted: the active ones, or those of the rim.
  margin: i32,      // How far beyond the box of the smoke cells are active: nothing is seen there.
}

@group(2) @binding(0) var<uniform> now: Paint;

// \`state_at\` reads the states. \`painted_at\` and \`set_painted\` are by row and part: linear colour, and
// the factor of density. Of the rim, rows that follow the active ones: minus the layer in which its
// colour was found, or 0.

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
      between[p] += share.x * share.y * share.z * state_at(row, p);
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
      seen = state_at(row, 0u);
    } else {
      seen = seen_at(cell, 2 * vec3i(part * now.samples + sample) + 1 - along, along);
    }
    sum += vec4f(linear_of(seen.xyz), 1.0 + clamp(seen.w, -0.5, 0.5));
  }
  set_painted(row, number % parts, sum / f32(count));
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
  let own = number % parts;
  if (now.layer == 0u) {
    set_painted(row, own, vec4f(1.0, 1.0, 1.0, 0.0));
    return;
  }
  if (painted_at(row, own).w != 0.0) {
    return;
  }
  let size = i32(now.parts);
  let fine = cell_of(row) * size + vec3i(part_of(own));
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
    let colour = painted_at(there, (inside.x * now.parts + inside.y) * now.parts + inside.z);
    let known = -colour.w;
    if (known < 0.0 || (known > 0.0 && known < f32(now.layer))) {
      sum += vec4f(colour.xyz, 1.0);
    }
  }
  if (sum.w > 0.0) {
    set_painted(row, own, vec4f(sum.xyz / sum.w, -f32(now.layer)));
  }
}
`;var Bs=`// What is seen of a state between cells: its first four channels and what three sine layers add.
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
`;var zs=`// One step: s' = s + m · W2 relu(W1 [perception ‖ priors ‖ 1]), the bias being W1's last column.
//
// A row of the state is PLANES vectors of four channels; of what cells are told, TOLD vectors, whose
// last number is the 1. A group of threads draws the mask for some cells and then shares those that
// change among its threads: the others cost nothing but a copy. \`state_at\` reads the states of all
// cells; \`told\` and \`next\` are those of the batch.

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
@group(0) @binding(6) var<storage, read_write> next: array<vec4f>;

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
      let seen = state_at(beside, p);
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
    inputs[FILTERS * PLANES + i] = vec4<Factor>(told[(row - batch.first) * TOLD + i]);
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
    next[(row - batch.first) * PLANES + p] = state_at(row, p) + change[p];
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
    if (first + at >= batch.rows) {
      continue;
    }
    let row = batch.first + first + at;
    if (changes(row)) {
      changing[atomicAdd(&found, 1u)] = row;
    } else {
      for (var p = 0u; p < PLANES; p++) {
        next[(row - batch.first) * PLANES + p] = state_at(row, p);
      }
    }
  }
  workgroupBarrier();
  let count = atomicLoad(&found);
  for (var at = thread; at < count; at += THREADS) {
    update(changing[at]);
  }
}
`;var ve={group:0,first:512,element:"vec4f",width:"PLANES"},ei={group:2,first:16,element:"vec4f"},ti={group:1,first:16,element:"u32"},Xt=class{planes;sizes;factor;fields;constructor(e,r,i){let s=e.decoder.length>0?D(e.decoder[0].weights.rows):0,n=D(e.width+1);this.factor=i?`enable f16;
alias Factor = f16;
`:`alias Factor = f32;
`,this.planes=`const PLANES = ${D(e.channels)}u;
`,this.sizes=`const TOLD = ${n}u;
const HIDDEN = ${e.hidden.rows}u;
const UNITS4 = ${s}u;
`,this.fields=va(e,r)}step(e,r){let i=`${ue(e)}${r.declared("state",ve)}`;return`${this.factor}${this.planes}${this.sizes}${i}${zs}`}condition(e,r){return`${ue(e)}${Q(r)}${this.fields}${Ps}`}carry(e,r,i,s){let n=r.declared("wanted_place",ti),a=i.declared("before",{...ve,group:1});return`${this.planes}${ue(e)}${Q(s)}${n}${a}${As}`}erase(e,r){return`${this.planes}${ue(e)}${Q(r)}${ut}${Ls}`}paint(e,r,i){let n=r.declared("state",{...ve,group:2})+i.declared("painted",{...ei,width:"(now.parts * now.parts * now.parts)",isWritten:!0});return`${this.planes}${this.sizes}${ue(e)}${n}${Bs}${Us}`}};function va(t,e){let r=s=>`${Math.fround(s).toExponential()}f`,i=[];for(let{name:s,scale:n,column:a}of t.fields){let l=0;for(let c of e.fields){for(let u=0;c.name===s&&u<c.width;u++){let h=`${r(c.scale)} * field_at(${l+u}u, cell) / ${r(n)}`;i.push(`  told[first + ${a+u}u] = ${h};
`)}l+=c.width}}return`fn tell_fields(first: u32, cell: vec3i) {
${i.join("")}}
`}var Qt=256,Cs=64,Zt=class t{constructor(e,r,i,s){this.gpu=e;this.rule=r;this.smoke=i;this.isHalf=s;let n=4*D(r.width+1);this.programs=new Xt(r,i,s),this.uniform=e.uniform(64),this.steps=e.uniform(Qt*Cs),this.filters=e.uniform(864),e.write(this.filters,Ms(r.sobel,r.laplacian)),this.weights=e.buffer(Zr(r,n,s)),this.network=e.buffer(Jr(r)),this.given=e.uniform(112),this.wanted=e.uniform(48),this.now=Array.from({length:2+4*Ht},()=>e.uniform(32))}gpu;rule;smoke;isHalf;stepsDone=0;uniform;work=null;painting=null;programs;steps;filters;weights;network;given;wanted;now;static async create(e,r,i,s){for(let{name:c,width:u}of r.fields){let h=i.fields.some(f=>f.name===c&&f.width===u);L(h,`${r.name}: the rule is conditioned on ${c}, which this sequence does not have`)}let n=new t(e,r,i,s&&e.hasHalf),{programs:a}=n,{WHOLE:l}=W;return await e.prepare([[a.step(l,l),"step"],[a.condition(l,l),"condition"],[a.carry(l,l,l,l),"carry"],[a.paint(l,l,l),"paint"],[a.paint(l,l,l),"rim"]]),n}get sites(){return this.work?.sites??null}get state(){return this.work?.state??null}get places(){return this.work?.places??null}get painted(){return this.painting}learn(e){let r=i=>JSON.stringify([i.channels,i.hidden,i.columns,i.width,i.dilation,i.decoder.length].map(s=>typeof s=="object"&&"values"in s?[s.rows,s.columns]:s));return r(e)!==r(this.rule)?!1:(this.gpu.write(this.weights,Zr(e,4*D(e.width+1),this.isHalf)),this.gpu.write(this.network,Jr(e)),this.rule=e,!0)}enter(e,r,i){let{gpu:s,rule:n}=this,a=ds(this.smoke,e.frame,n.density,n.dilation,n.wholeBox),l=this.prepared(a);this.work!==null&&a.cells>0&&this.carry(e,this.work,l,r,i),this.release(),s.write(this.uniform,a.uniform),this.work=l,this.condition(e,r)}prepared(e){let{gpu:r,rule:i}=this,[s,n]=[16*D(i.channels),16*D(i.width+1)],a=W.of(r,e.cells+1,s,n),l=j.of(r,e.places,"the list of cells");r.requireBindings(l.layout.parts+a.parts+3,"the cells of the smoke");let c=Array.from({length:Math.ceil(e.cells/a.each)},(d,m)=>{let p=r.uniform(16),g=m*a.each;return r.write(p,new Uint32Array([g,Math.min(a.each,e.cells-g)])),p}),u=j.empty(r,new W(e.cells,n,a.each),"the conditioning"),[h,f]=[0,1].map(()=>j.empty(r,a,"the state"));return{sites:e,places:l,told:u,batches:c,state:h,spare:f}}carry(e,r,i,s,n){let{gpu:a}=this,[,,,,,,,,,,,l,c,u,h]=i.sites.uniform,f=new ArrayBuffer(48);new Uint32Array(f).set([c*u*h,l]);let d=new Float32Array(f);d.set([n,...this.alongCells(s.direction),s.amount,this.rule.speed],3),a.write(this.wanted,d);let m=[r.places,i.places,r.state,e.words].map(({layout:M})=>M);a.requireBindings(m.reduce((M,{parts:B})=>M+B,1),"the cells of two frames");let[p,g,S,E]=m,v=a.compute(this.programs.carry(p,g,S,E),"carry"),T={0:this.wanted,...i.places.bindings(ti.first),...r.state.bindings(ve.first)};this.eachBatch(i,v,r.places,M=>[{...T,3:i.state.buffers[M]},e.bindings()])}eachBatch({batches:e,state:r,sites:i},s,n,a){let{gpu:l}=this,c=Math.min(r.layout.each,i.cells);l.submit(u=>e.forEach((h,f)=>{let m=[{0:this.uniform,1:h,...n.bindings(ye.first)},...a(f)].map((p,g)=>l.bound(s,g,p));N(u,s,m,Math.ceil(c/64))}))}condition(e,r){let{gpu:i,rule:s,work:n}=this;if(n===null||n.sites.cells===0)return;let a=new ArrayBuffer(112),l=new Float32Array(a),c=this.placeMatrix();for(let g=0;g<16;g++)l[g]=c[g%4][g>>2];let{position:u=-1,density:h=-1,velocity:f=-1}=s.columns;new Int32Array(a).set([u,h,f,4*D(s.width+1)],16),l.set([s.density,s.speed],20),l.set([...this.alongCells(r.direction),r.amount],24),i.write(this.given,l);let{places:d,told:m}=n,p=this.programs.condition(d.layout,e.words.layout);this.eachBatch(n,i.compute(p,"condition"),d,g=>[{0:this.given,1:m.buffers[g]},e.bindings()])}alongCells(e){let r=ne(this.smoke.toWorld),i=[0,1,2].map(n=>e.reduce((a,l,c)=>a+r[n][c]*l,0)),s=Math.hypot(...i)||1;return i.map(n=>n/s)}placeMatrix(){let{place:e,dilation:r}=this.rule,i=[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]],s=this.smoke.lower.map(a=>a-r),n=this.smoke.upper.map(a=>a+r);if(e!==null){let a=si(ne(e.toWorld),this.smoke.toWorld);this.isNear(a,e.lower,e.upper)&&([i,s,n]=[a,e.lower,e.upper])}return i.map((a,l)=>{if(l===3)return a;let c=2/(n[l]-s[l]),u=a.map(h=>h*c);return u[3]+=(1-2*s[l])/(n[l]-s[l])-1,u})}isNear(e,r,i){let s=[1/0,1/0,1/0],n=[-1/0,-1/0,-1/0];for(let a=0;a<8;a++){let l=[0,1,2].map(c=>(a>>c&1?this.smoke.upper:this.smoke.lower)[c]-.5);for(let c=0;c<3;c++){let[u,h,f,d]=e[c],m=u*l[0]+h*l[1]+f*l[2]+d;s[c]=Math.min(s[c],m),n[c]=Math.max(n[c],m)}}return[0,1,2].every(a=>n[a]>r[a]-.5&&s[a]<i[a]-.5)}step(e,r){let{gpu:i,rule:s,work:n}=this;for(let a=0;a<e;){let l=Math.min(Cs,e-a),c=new Uint32Array(Qt/4*l);for(let u=0;u<l;u++){let h=_s(r,this.stepsDone+a+u),f=s.probability>=1?1:0;c.set([h,Ts(s.probability),f,0],Qt/4*u)}i.write(this.steps,c),n!==null&&n.sites.cells>0&&this.submitSteps(n,l),a+=l}this.stepsDone+=e}submitSteps(e,r){let{gpu:i}=this,{places:s,told:n,batches:a}=e,l=i.compute(this.programs.step(s.layout,e.state.layout),"step"),c=Math.min(e.state.layout.each,e.sites.cells),u={0:this.uniform,3:this.filters,4:this.weights,...s.bindings(ye.first)};i.submit(h=>{for(let f=0;f<r;f++)a.forEach((d,m)=>{let p=i.bound(l,0,{...u,1:d,2:{buffer:this.steps,offset:Qt*f,size:16},5:n.buffers[m],6:e.spare.buffers[m],...e.state.bindings(ve.first)});N(h,l,[p],Math.ceil(c/256))}),[e.state,e.spare]=[e.spare,e.state]})}erase(e,r){let{work:i}=this;if(i===null||i.sites.cells===0)return;let s=this.programs.erase(i.places.layout,e.words.layout);this.eachBatch(i,this.gpu.compute(s,"erase"),i.places,n=>[{...r,3:i.state.buffers[n]},e.bindings(!1)])}get shown(){return this.work===null?0:this.work.sites.cells+this.work.sites.beside}paintedLayout(e){return W.of(this.gpu,this.shown,16*e**3)}boundFor(e,r){if(this.work===null)return 0;let{places:i,state:s}=this.work,n=Math.max(s.layout.parts+1,r);return i.layout.parts+this.paintedLayout(e).parts+n}paint(e,r){let{gpu:i,rule:s,work:n}=this;if(n===null)return;let{sites:a,places:l,state:c}=n,u=this.paintedLayout(e);if((this.painting?.layout.count!==u.count||this.painting.layout.width!==u.width)&&(this.painting?.destroy(),this.painting=j.empty(i,u,"the painting")),u.count===0)return;i.requireBindings(this.boundFor(e,0),"the painting");let h=this.programs.paint(l.layout,c.layout,u),[f,d]=[i.compute(h,"paint"),i.compute(h,"rim")],m=[a.cells,...Array(Ht*e+1).fill(a.beside)];m.forEach((E,v)=>{let T=new Int32Array([e,r,Math.max(v-1,0),E,s.dilation,0,0,0]);i.write(this.now[v],T)});let p={0:this.uniform,...l.bindings(ye.first)},g=this.painting.bindings(ei.first),S=[i.bound(f,0,p),i.bound(f,1,{0:this.network}),i.bound(f,2,{0:this.now[0],...g,...c.bindings(ve.first)})];i.submit(E=>{let v=T=>Math.ceil(T*e**3/64);a.cells>0&&N(E,f,S,v(a.cells));for(let T=1;T<m.length&&a.beside>0;T++){let M=[i.bound(d,0,p),i.bound(d,1,{}),i.bound(d,2,{0:this.now[T],...g})];N(E,d,M,v(a.beside))}})}reset(){this.release(),this.work=null,this.stepsDone=0}release(){if(this.work!==null){let{places:e,state:r,spare:i,told:s,batches:n}=this.work;for(let a of[e,r,i,s,...n])a.destroy()}this.painting?.destroy(),this.painting=null}destroy(){this.release();let e=[this.uniform,this.steps,this.filters,this.weights,this.network,this.given];for(let r of[...e,this.wanted,...this.now])r.destroy()}};var ri=`// The picture on the screen: in front of the soft background of films, as sRGB.

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
`;var xa=[.005181516702338386,.005181516702338386,.006995410187265387],Jt=class t{constructor(e,r){this.gpu=e;this.format=r;this.uniform=e.uniform(32),this.sampler=e.device.createSampler({magFilter:"linear",minFilter:"linear"})}gpu;format;uniform;sampler;static async create(e,r){return await e.prepareRender(ri,"present",r),new t(e,r)}present(e,r,[i,s],{light:n,exposure:a,wipe:l}){let{gpu:c}=this,u=c.render(ri,"present",this.format),h=n>0?1:0,f=[...xa,h,2**a,l,i,s];c.write(this.uniform,new Float32Array(f)),c.submit(d=>{let m=d.beginRenderPass({colorAttachments:[{view:r,loadOp:"clear",storeOp:"store",clearValue:[0,0,0,1]}]});m.setPipeline(u);let p={0:this.uniform,1:e.createView(),2:this.sampler};m.setBindGroup(0,c.bound(u,0,p)),m.draw(3),m.end()})}async pixels(e,[r,i],s){let n=GPUTextureUsage.RENDER_ATTACHMENT|GPUTextureUsage.COPY_SRC,a=[r,i],l=this.gpu.device.createTexture({size:a,format:this.format,usage:n});this.present(e,l.createView(),[r,i],s);let c=new Uint8ClampedArray(await this.gpu.pixels(l,4));if(l.destroy(),this.format==="bgra8unorm")for(let u=0;u<c.length;u+=4)[c[u],c[u+2]]=[c[u+2],c[u]];return c}};var Sa=4,Ea=30,Rs=.5,$s={1:3,2:2,3:2,4:2},er=class t{constructor(e,r,i,s,n,a){this.gpu=e;this.smoke=r;this.painting=i;this.plain=s;this.brush=n;this.screen=a;this.camera=this.framed(1)}gpu;smoke;painting;plain;brush;screen;settings={...he};camera;at=-1;layers=[];samples=0;buffers=null;stale={state:!0,look:!0};picture=null;static async create(e,r,i){Wt(e,r,1);let[s,n,a,l]=await Promise.all([ft.create(e,r),ft.create(e,r),Yt.create(e,r),Jt.create(e,i)]);return new t(e,r,s,n,a,l)}framed(e,r=0,i=5){let[s,n]=Dr(this.smoke,this.smoke.toWorld);return li(s,n,r,i,e,Ea)}async use(e,r){let i=this.settings.half>0,s=e===null?null:await Zt.create(this.gpu,e,this.smoke,i);this.layers[r]?.destroy(),s===null?this.layers.length=r:(this.layers[r]=s,this.buffers!==null&&this.begin(s)),this.stale.state=!0}get guide(){let{guide:e,guideAzimuth:r,guideElevation:i}=this.settings,[,,s]=H(r,-i);return{direction:s,amount:e}}begin(e){e.enter(this.buffers,this.guide,0),this.frameSteps(e,this.settings.warmup)}frameSteps(e,r){let i=this.settings.steps||e.rule.steps;e.step(r+i,this.settings.seed)}async show(e){this.enterFrame(await this.smoke.frame(e),e)}enterFrame(e,r){let i=this.passed(e,r);this.buffers?.destroy(),this.buffers=jt.upload(this.gpu,this.smoke,e),this.at=r;for(let s of this.layers){let n=s.sites===null||s.sites.cells===0;s.enter(this.buffers,this.guide,i*this.patternSpeed(s)),this.frameSteps(s,n?this.settings.warmup:0)}this.stale.state=!0,r+1<this.smoke.length&&this.smoke.frame(r+1).catch(()=>{})}passed(e,r){if(this.buffers===null)return 0;let i=e.number-this.buffers.frame.number;return r===this.at+1||Math.abs(i)<=Sa?i:0}patternSpeed({rule:e}){let{patternSpeed:r}=this.settings;return r<0?Number(e.transport):r}async restart(){for(let e of this.layers)e.reset();this.brush.brushed.clear(),await this.show(0)}step(e){for(let r of this.layers)r.step(e,this.settings.seed);this.stale.state=!0}conditionAgain(){if(this.buffers!==null)for(let e of this.layers)e.condition(this.buffers,this.guide)}lookAgain(){this.stale.look=!0}look(e=!1){let r=this.settings,[i]=this.layers;return{strength:e?0:r.strength,densityStrength:r.densityStrength,gamma:i.rule.gamma*r.density,light:{strength:r.light,azimuth:r.lightAzimuth,elevation:r.lightElevation,ambient:r.ambient},isPlain:e,mixed:r.mix}}get parts(){if(!this.layers.every(s=>s.rule.decoder.length>0))return 1;let e=this.gpu.device.limits.maxStorageBuffersPerShaderStage,r=this.brush.brushed.layout.parts+(this.buffers?.words.layout.parts??0),i=this.settings.detail;for(;i>1&&this.layers.some(s=>s.boundFor(i,r)>e);)i--;return i}prepare(){if(this.buffers===null||this.layers.length===0)return;let{parts:e}=this;if(e!==this.painting.refinement&&(this.stale.state=!0),this.stale.state){let r=this.samples||$s[e];for(let i of this.layers)i.paint(e,Math.min(r,$s[e]))}if((this.stale.state||this.stale.look)&&(this.painting.refine(e),this.painting.draw(this.buffers,this.layers,this.brush.brushed,this.look()),this.settings.wipe<1)){this.plain.refine(1);let[r]=this.layers;this.plain.draw(this.buffers,[r],this.brush.brushed,this.look(!0))}this.stale={state:!1,look:!1}}take(e,r){this.prepare(),(this.picture?.width!==e||this.picture.height!==r)&&(this.picture?.destroy(),this.picture=this.gpu.device.createTexture({size:[e,r],format:Kt,usage:GPUTextureUsage.RENDER_ATTACHMENT|GPUTextureUsage.TEXTURE_BINDING|GPUTextureUsage.COPY_SRC}));let i=this.picture;if(this.buffers===null||this.layers.length===0)return i;let s=Math.min(this.settings.wipe,1);return this.gpu.submit(n=>{let{camera:a}=this;this.painting.take(n,i,a,this.look(),Rs,[0,s]),s<1&&this.plain.take(n,i,a,this.look(!0),Rs,[s,1],!1)}),i}present(e,r,i,s){this.screen.present(e,r,[i,s],this.settings)}async pixels(e,r){return this.screen.pixels(this.take(e,r),[e,r],this.settings)}touch(e,r,i){if(this.buffers===null||this.layers.length===0)return;this.prepare();let{camera:s,painting:n}=this,a={camera:s,aspect:i,picture:n,gamma:this.look().gamma};this.brush.point(r,a,e,this.settings.brush),e==="erase"?(this.brush.erase(this.layers,this.buffers),this.stale.state=!0):(this.brush.blend(this.buffers),this.stale.look=!0)}};var _a=15,Ta=9,Is=.3,Ma=250,Aa=1.22,Pa=.07,La=["guide","guideAzimuth","guideElevation"],tr=class t extends EventTarget{constructor(r,i,s){super();this.canvas=r;this.show=i;this.smoke=s}canvas;show;smoke;gpu;stage;isPlaying=!1;isAlive=!0;speed=1;tool="orbit";names=["",""];fineness=1;took=0;context;isDirty=!0;isSettled=!1;lastChange=0;due=0;isBusy=!1;waiting=0;isClosed=!1;rules=new Map;static async open(r,i){let s=new t(r,i,await Ot.open(i.smoke));return await s.start(),new ResizeObserver(()=>s.resized()).observe(r),requestAnimationFrame(s.tick),s}async start(){this.gpu=await Nt.open();let r=navigator.gpu.getPreferredCanvasFormat(),i=this.canvas.getContext("webgpu");if(i===null)throw new P("This browser gives WebGPU no canvas.");this.context=i,i.configure({device:this.gpu.device,format:r,alphaMode:"opaque"}),this.gpu.device.addEventListener("uncapturederror",s=>{$(`The GPU complains: ${R(s.error.message)}`)}),this.stage=await er.create(this.gpu,this.smoke,r),this.reframe(),this.gpu.lost.then(s=>this.recover(s))}async recover(r){if(this.isClosed)return;let{settings:i,camera:s,at:n}=this.stage;$("The GPU was lost; the page begins again.");try{await this.start(),Object.assign(this.stage.settings,i),this.stage.camera=s,await this.use(this.names[0],0),this.names[1]&&await this.use(this.names[1],1),await this.goTo(Math.max(n,0)),this.dispatchEvent(new Event("recovered"))}catch(a){kt("The GPU is gone",`${R(a)} ${r.message}`)}}close(){this.isClosed=!0,this.gpu.device.destroy()}get aspect(){return(this.canvas.clientWidth||1)/(this.canvas.clientHeight||1)}resized(){this.changed()}changed(){this.isDirty=!0,this.isSettled=!1,this.lastChange=performance.now(),this.dispatchEvent(new Event("change"))}async rule(r){let i=this.rules.get(r);if(i===void 0){let s=this.show.rules.find(n=>n.name===r);if(s===void 0)throw new P(`There is no rule '${r}' here.`);i=Ft(await lt(s.model),r),this.rules.set(r,i)}return i}async use(r,i){let s=r===""?null:await this.rule(r);await this.exclusively(()=>this.stage.use(s,i)),this.names[i]=r,i===1&&r!==""&&this.stage.settings.mix===0&&this.set("mix",.5),this.changed(),this.dispatchEvent(new Event("rules"))}async add(r){let i=Ft(await r.arrayBuffer(),r.name);this.rules.set(r.name,i),this.show.rules.unshift({name:r.name,title:i.title,model:""}),await this.use(r.name,0)}async learned(r){let i=this.names[0],s=Ft(r,i);this.rules.set(i,s);let[n]=this.stage.layers;n?.learn(s)||await this.use(i,0),this.changed()}set(r,i){this.stage.settings[r]=i,La.includes(r)&&this.stage.conditionAgain(),r==="half"&&this.names.forEach((s,n)=>{this.use(s,n)}),this.stage.lookAgain(),this.changed()}get defaults(){return he}isDefault(r){return this.stage.settings[r]===(this.show.settings[r]??he[r])}async exclusively(r){for(this.waiting++;this.isBusy;)await new Promise(i=>setTimeout(i,5));this.waiting--,this.isBusy=!0;try{await r()}finally{this.isBusy=!1}}async goTo(r){let i=Math.min(Math.max(r,0),this.smoke.length-1);await this.exclusively(()=>this.stage.show(i)),this.changed()}async restart(){await this.exclusively(()=>this.stage.restart()),this.changed()}async play(){this.stage.at===this.smoke.length-1&&await this.restart(),this.isPlaying=!0,this.due=performance.now(),this.changed()}pause(){this.isPlaying=!1,this.changed()}look(r){r(this.stage.camera),this.changed()}reframe(){let r=this.stage.framed(this.aspect);r.distance*=Aa,sr(r,0,Pa),this.stage.camera=r,this.changed()}move(r,i){this.look(s=>sr(s,r,i))}async touch(r,i){let{tool:s}=this;if(s!=="orbit"){if(s!=="erase"&&this.stage.layers.length<2){$("Choose a second style to brush it on.");return}await this.exclusively(async()=>this.stage.touch(s,[r-.5,.5-i],this.aspect)),this.changed()}}tick=async r=>{if(!(this.isClosed||(requestAnimationFrame(s=>{this.tick(s)}),this.isBusy||this.waiting>0||document.hidden||this.stage.layers.length===0))){this.isBusy=!0;try{await this.frame(r)}catch(s){this.isPlaying=!1,$(R(s))}finally{this.isBusy=!1}}};async frame(r){let i=performance.now();this.isPlaying&&r>=this.due?await this.advance(r):this.isAlive&&!this.isPlaying&&!this.isSettled&&this.stage.at>=0&&(this.stage.step(1),this.isDirty=!0);let s=r-this.lastChange>Ma&&!this.isPlaying;!this.isDirty&&(this.isSettled||!s)||(this.isDirty=!1,this.draw(s?1:this.fineness),this.isSettled=s&&!this.isAlive,await this.gpu.device.queue.onSubmittedWorkDone(),s||this.adapt(performance.now()-i))}async advance(r){let i=this.stage.at+1;if(i>=this.smoke.length){this.isPlaying=!1,this.dispatchEvent(new Event("ended")),this.changed();return}let s=r-this.due,n=1e3/(this.smoke.fps*this.speed);this.due=s>n?r+n:this.due+n,await this.stage.show(i),this.isDirty=!0,this.dispatchEvent(new Event("frame"))}draw(r){let i=window.devicePixelRatio||1,s=this.gpu.device.limits.maxTextureDimension2D,n=Math.min(Math.max(Math.round(this.canvas.clientWidth*i),1),s),a=Math.min(Math.max(Math.round(this.canvas.clientHeight*i),1),s);(this.canvas.width!==n||this.canvas.height!==a)&&([this.canvas.width,this.canvas.height]=[n,a]);let l=this.stage.take(Math.max(Math.round(n*r),16),Math.max(Math.round(a*r),16));this.stage.present(l,this.context.getCurrentTexture().createView(),n,a)}adapt(r){this.took=this.took===0?r:.8*this.took+.2*r,this.took>_a?this.fineness>Is?this.fineness=Math.max(this.fineness*.92,Is):this.stage.samples=1:this.took<Ta&&(this.stage.samples===1?this.stage.samples=0:this.fineness=Math.min(this.fineness*1.04,1))}};var Ua=document.getElementById("canvas");async function Ba(){let t=await rs();document.title=`${t.title} · vnca`;let e=await tr.open(Ua,t);Object.assign(e.stage.settings,za(t.settings,e)),Object.assign(globalThis,{viewer:e}),await or(e,location.hash),window.addEventListener("hashchange",()=>{or(e,location.hash)}),Ca(e),document.body.classList.add("ready"),t.run?ns(e):location.hash||await e.play()}function za(t,e){let i=Object.keys(e.defaults).filter(s=>Number.isFinite(t[s]));return Object.fromEntries(i.map(s=>[s,ar(s,t[s])]))}function Ca(t){let e=k("span",{id:"painted"}),r=()=>{let[i,s]=t.names.map(n=>n.replaceAll("_"," "));e.textContent=s?`${i} and ${s}`:i};t.addEventListener("rules",r),r(),window.innerWidth<720&&document.body.classList.add("bare"),document.body.append(k("header",{},k("h1",{},t.smoke.name),e),Yi(t),Ji(t),k("footer",{},as(t),Qi(t)),ts(t),di()),hi(t),Zi(t),document.addEventListener("dragover",i=>i.preventDefault()),document.addEventListener("drop",i=>{i.preventDefault();let s=i.dataTransfer?.files[0];s&&t.add(s).catch(n=>$(R(n)))})}Ba().catch(t=>{let e=R(t),r=/WebGPU/.test(e);kt(r?"No WebGPU here":"This cannot be shown",r?`${e} ${wi}`:e)});
