/* vnca, Apache-2.0; sources b9b06f8041936a6708205d51f6b3d0c7d43b383c2a8da0686ef8271cbdee7a4e */
function v(t,e={},...r){let i=document.createElement(t);for(let[s,n]of Object.entries(e))typeof n=="function"?i.addEventListener(s.slice(2),n):typeof n=="boolean"?i.toggleAttribute(s,n):i.setAttribute(s,String(n));return i.append(...r),i}function zs(t){let e="http://www.w3.org/2000/svg",r=document.createElementNS(e,"svg");r.setAttribute("viewBox","0 0 24 24"),r.setAttribute("aria-hidden","true");let i=document.createElementNS(e,"path");return i.setAttribute("d",t),r.append(i),r}function V(t,e,r){let i=v("button",{type:"button",title:t,"aria-label":t,onclick:r});return i.append(zs(e)),i}function Qr(t,e){let r=URL.createObjectURL(t);v("a",{href:r,download:e}).click(),setTimeout(()=>URL.revokeObjectURL(r),6e4)}function Zr(t,e){return t.map(r=>[0,1,2,3].map(i=>r.reduce((s,n,a)=>s+n*e[a][i],0)))}function Xt(t,e){return[0,1,2].map(r=>ht(t[r],e)+t[r][3])}function Jr(t,e){return[0,1,2].map(r=>ht(t[r],e))}function ht(t,e){return t[0]*e[0]+t[1]*e[1]+t[2]*e[2]}function he(t){let[e,r,i]=t.map(u=>u.slice(0,3)),s=(u,d)=>[u[1]*d[2]-u[2]*d[1],u[2]*d[0]-u[0]*d[2],u[0]*d[1]-u[1]*d[0]],n=[s(r,i),s(i,e),s(e,r)],a=ht(e,n[0]),l=[0,1,2].map(u=>n.map(d=>d[u]/a)),c=[t[0][3],t[1][3],t[2][3]];return[...l.map(u=>[...u,-ht(u,c)]),[0,0,0,1]]}function dt(t){if(!Array.isArray(t)||t.length!==4)return!1;let e=i=>typeof i=="number"&&Math.abs(i)<1e30;return t.every(i=>Array.isArray(i)&&i.length===4&&i.every(e))?[0,0,0,1].every((i,s)=>t[3][s]===i)&&he(t).flat().every(i=>Math.abs(i)<1e30):!1}function ft(t){if(!Array.isArray(t)||t.length!==2)return!1;let e=n=>Number.isInteger(n)&&Math.abs(n)<2**30,[r,i]=t;return t.every(n=>Array.isArray(n)&&n.length===3&&n.every(e))&&r.every((n,a)=>n<i[a])}function I(t,e,r=1){return t.map((i,s)=>i+r*e[s])}function N(t,e){return t.map(r=>r*e)}function ei(t,e){return t.reduce((r,i,s)=>r+i*e[s],0)}var Qt=Math.PI/180,Cs=.04;function H(t,e){let[r,i]=[t*Qt,e*Qt],s=[Math.cos(r),Math.sin(r),0],n=[-Math.sin(r),Math.cos(r),0],a=[0,0,1],l=I(N(n,Math.sin(i)),a,Math.cos(i)),c=I(N(n,Math.cos(i)),a,-Math.sin(i));return[s,l,c]}function Z(t){return Math.tan(t*Qt/2)}function mt(t){let[,,e]=H(t.azimuth,t.elevation);return I(t.target,e,-t.distance)}function ri(t,e,r,i,s,n){let a=H(r,i),l=N(I(t,e),.5),c=Array.from({length:8},(E,_)=>I([0,1,2].map(M=>(_>>M&1?e:t)[M]),l,-1)),[u,d,m]=a.map(E=>c.map(_=>ei(_,E))),h=(1-2*Cs)*Z(n),[f,p]=ti(u,m,h*s),[g,T]=ti(d,m,h);return{target:I(I(l,a[0],f),a[1],g),azimuth:r,elevation:i,distance:Math.max(p,T),fieldOfView:n}}function ti(t,e,r){let i=Math.max(...t.map((n,a)=>n-r*e[a])),s=Math.max(...t.map((n,a)=>-n-r*e[a]));return[(i-s)/2,(i+s)/(2*r)]}var ii=.35,si=89,Rs=12;function Zt(t,e,r){t.azimuth=((t.azimuth+e)%360+360)%360,t.elevation=Math.min(Math.max(t.elevation+r,-si),si)}function Jt(t,e,r){let[i,s]=H(t.azimuth,t.elevation),n=2*t.distance*Z(t.fieldOfView);t.target=I(I(t.target,i,-e*n),s,-r*n)}function We(t,e,r,i){t.distance=Math.min(Math.max(t.distance*e,r),i)}function ni(t){let{canvas:e}=t,r=new Map,i=t.stage.camera.distance,s=i/20,n=i*10,a=!1,l=async h=>{if(a)return;a=!0;let{left:f,top:p,width:g,height:T}=e.getBoundingClientRect();await t.touch((h.clientX-f)/g,(h.clientY-p)/T),a=!1},c=h=>{let{left:f,width:p}=e.getBoundingClientRect();return(h.clientX-f)/p},u=!1,d=h=>t.tool!=="orbit"&&r.size===1&&!h.shiftKey&&!(h.buttons&6);e.addEventListener("pointerdown",h=>{e.setPointerCapture(h.pointerId),r.set(h.pointerId,h);let{wipe:f}=t.stage.settings;u=f<1&&Math.abs(c(h)-f)*e.clientWidth<Rs,!u&&d(h)&&l(h)}),e.addEventListener("pointermove",h=>{let f=r.get(h.pointerId);if(f===void 0)return;let p=h.clientX-f.clientX,g=h.clientY-f.clientY,T=[...r.values()].find(E=>E.pointerId!==h.pointerId);if(r.set(h.pointerId,h),u)t.set("wipe",Math.min(Math.max(c(h),.02),.98));else if(d(h))l(h);else if(T!==void 0){let E=_=>Math.hypot(_.clientX-T.clientX,_.clientY-T.clientY)||1;t.look(_=>We(_,E(f)/E(h),s,n)),t.move(p/2/e.clientHeight,-g/2/e.clientHeight)}else h.shiftKey||h.buttons&6?t.move(p/e.clientHeight,-g/e.clientHeight):t.look(E=>Zt(E,-ii*p,ii*g))});let m=h=>{r.delete(h.pointerId),u=!1};e.addEventListener("pointerup",m),e.addEventListener("pointercancel",m),e.addEventListener("contextmenu",h=>h.preventDefault()),e.addEventListener("wheel",h=>{h.preventDefault();let f=h.deltaMode===WheelEvent.DOM_DELTA_LINE?30:1;t.look(p=>We(p,Math.exp(f*h.deltaY/900),s,n))},{passive:!1}),e.addEventListener("dblclick",()=>t.reframe())}var $s=[["Turn","drag","Shift ← → · ↑ ↓"],["Pan","Shift or right button, drag · two fingers",""],["Zoom","wheel · pinch","+ −"],["Frame the smoke","double click","F"],["Play · frame by frame · from the start","","Space · ← → · R"],["Another style","click its picture","N"],["Mix a second style in","right click, or hold, its picture",""],["Turn · erase · second style on · off","drag over the smoke","1 · 2 · 3 · 4"],["Beside the plain smoke","drag the line","B"],["Go on while nothing plays","","L"],["Save a picture · copy a link","","P · C"],["Settings","double click resets a slider","H"],["A model of your own","drop its file onto the page",""]];function ai(){let t=$s.map(([i,s,n])=>v("tr",{},v("th",{scope:"row"},i),v("td",{},s),v("td",{class:"keys"},n))),e=v("button",{type:"button",class:"close",autofocus:!0},"Close"),r=v("dialog",{id:"help","aria-label":"What can be done"},v("h2",{},"What can be done"),v("table",{},...t),e);return e.addEventListener("click",()=>r.close()),r.addEventListener("click",i=>{i.target===r&&r.close()}),r}function pt(){let t=document.getElementById("help");t.open?t.close():t.showModal()}var de={seed:0,steps:0,warmup:64,patternSpeed:-1,strength:1,densityStrength:1,density:1,exposure:0,light:1.5,lightAzimuth:-55,lightElevation:40,ambient:.25,guide:0,guideAzimuth:0,guideElevation:90,mix:0,wipe:2,detail:1,brush:5,half:0};var oi=Object.keys(de),li=["azimuth","elevation","distance"],Is={seed:[0,2**31],exposure:[-16,16],guide:[0,1],mix:[0,1],wipe:[0,2],brush:[.5,64],detail:[1,4],strength:[0,1],densityStrength:[0,1],steps:[0,256],warmup:[0,4096],patternSpeed:[-1,8],density:[.001,1e3],light:[0,20],ambient:[0,1],half:[0,1]};function tr(t,e){let[r,i]=Is[t]??[-1e6,1e6],s=t==="detail"?Math.round(e):e;return Math.min(Math.max(s,r),i)}function ci(t){let e=new URLSearchParams,{settings:r,camera:i,at:s}=t.stage;t.names[0]!==t.show.rules[0].name&&e.set("rule",t.names[0]),t.names[1]&&e.set("with",t.names[1]);for(let a of oi)t.isDefault(a)||e.set(a,er(r[a]));for(let a of li)e.set(a,er(i[a]));e.set("target",i.target.map(er).join(",")),s>0&&e.set("frame",String(s));let n=new URL(location.href);return n.hash=e.toString(),n.href}async function rr(t,e){let r=new URLSearchParams(e.replace(/^#/,"")),i=u=>{let d=Number(r.get(u));return r.has(u)&&Number.isFinite(d)?d:null},{settings:s,camera:n}=t.stage;for(let u of oi){let d=i(u);d!==null&&(s[u]=tr(u,d))}for(let u of li){let d=i(u);d!==null&&(u!=="distance"||d>0)&&(n[u]=d)}let a=(r.get("target")??"").split(",").map(Number);a.length===3&&a.every(Number.isFinite)&&(n.target=a);let l=u=>t.show.rules.some(d=>d.name===u)?u:null;await t.use(l(r.get("rule"))??t.show.rules[0].name,0);let c=l(r.get("with"));c!==null&&await t.use(c,1),await t.goTo(Math.round(i("frame")??0))}function er(t){return String(Number(t.toPrecision(6)))}var L=class extends Error{};function C(t){let e=String(t instanceof Error?t.message:t).replace(/\s+/g," ").trim();return e.length>300?`${e.slice(0,300)}…`:e}function U(t,e){if(!t)throw new L(e)}var Ns=6e3,ui=0;function R(t){let e=document.getElementById("notice")??v("div",{id:"notice",role:"status"});e.textContent=C(t),e.classList.add("shown"),document.body.append(e),clearTimeout(ui),ui=window.setTimeout(()=>e.classList.remove("shown"),Ns)}function gt(t,e){document.getElementById("stopped")?.remove(),document.body.classList.add("stopped"),document.body.append(v("main",{id:"stopped"},v("h1",{},t),v("p",{id:"reason"},C(e))))}var hi="WebGPU is in current Chrome and Edge, in Safari 26 and in Firefox. On Linux Chrome may have to be started with --enable-unsafe-webgpu --enable-features=Vulkan.";var mr=(t,e,r)=>{if(!e.has(t))throw TypeError("Cannot "+r)},o=(t,e,r)=>(mr(t,e,"read from private field"),r?r.call(t):e.get(t)),b=(t,e,r)=>{if(e.has(t))throw TypeError("Cannot add the same private member more than once");e instanceof WeakSet?e.add(t):e.set(t,r)},S=(t,e,r,i)=>(mr(t,e,"write to private field"),i?i.call(t,r):e.set(t,r),r),w=(t,e,r)=>(mr(t,e,"access private method"),r),fi=class{constructor(t){this.value=t}},pr=class{constructor(t){this.value=t}},mi=t=>t<256?1:t<65536?2:t<1<<24?3:t<2**32?4:t<2**40?5:6,Ws=t=>{if(t<127)return 1;if(t<16383)return 2;if(t<(1<<21)-1)return 3;if(t<(1<<28)-1)return 4;if(t<2**35-1)return 5;if(t<2**42-1)return 6;throw new Error("EBML VINT size not supported "+t)},xe=(t,e,r)=>{let i=0;for(let s=e;s<r;s++){let n=Math.floor(s/8),a=t[n],l=7-(s&7),c=(a&1<<l)>>l;i<<=1,i|=c}return i},Vs=(t,e,r,i)=>{for(let s=e;s<r;s++){let n=Math.floor(s/8),a=t[n],l=7-(s&7);a&=~(1<<l),a|=(i&1<<r-s-1)>>r-s-1<<l,t[n]=a}};var Pt=class{},gr=class extends Pt{constructor(){super(...arguments),this.buffer=null}},pi=class extends Pt{constructor(t){if(super(),this.options=t,typeof t!="object")throw new TypeError("StreamTarget requires an options object to be passed to its constructor.");if(t.onData){if(typeof t.onData!="function")throw new TypeError("options.onData, when provided, must be a function.");if(t.onData.length<2)throw new TypeError("options.onData, when provided, must be a function that takes in at least two arguments (data and position). Ignoring the position argument, which specifies the byte offset at which the data is to be written, can lead to broken outputs.")}if(t.onHeader&&typeof t.onHeader!="function")throw new TypeError("options.onHeader, when provided, must be a function.");if(t.onCluster&&typeof t.onCluster!="function")throw new TypeError("options.onCluster, when provided, must be a function.");if(t.chunked!==void 0&&typeof t.chunked!="boolean")throw new TypeError("options.chunked, when provided, must be a boolean.");if(t.chunkSize!==void 0&&(!Number.isInteger(t.chunkSize)||t.chunkSize<1024))throw new TypeError("options.chunkSize, when provided, must be an integer and not smaller than 1024.")}},Gs=class extends Pt{constructor(t,e){if(super(),this.stream=t,this.options=e,!(t instanceof FileSystemWritableFileStream))throw new TypeError("FileSystemWritableFileStreamTarget requires a FileSystemWritableFileStream instance.");if(e!==void 0&&typeof e!="object")throw new TypeError("FileSystemWritableFileStreamTarget's options, when provided, must be an object.");if(e&&e.chunkSize!==void 0&&(!Number.isInteger(e.chunkSize)||e.chunkSize<=0))throw new TypeError("options.chunkSize, when provided, must be a positive integer")}},ne,A,ir,gi,sr,bi,nr,wi,bt,ar,or,yi,vi=class{constructor(){b(this,ir),b(this,sr),b(this,nr),b(this,bt),b(this,or),this.pos=0,b(this,ne,new Uint8Array(8)),b(this,A,new DataView(o(this,ne).buffer)),this.offsets=new WeakMap,this.dataOffsets=new WeakMap}seek(t){this.pos=t}writeEBMLVarInt(t,e=Ws(t)){let r=0;switch(e){case 1:o(this,A).setUint8(r++,128|t);break;case 2:o(this,A).setUint8(r++,64|t>>8),o(this,A).setUint8(r++,t);break;case 3:o(this,A).setUint8(r++,32|t>>16),o(this,A).setUint8(r++,t>>8),o(this,A).setUint8(r++,t);break;case 4:o(this,A).setUint8(r++,16|t>>24),o(this,A).setUint8(r++,t>>16),o(this,A).setUint8(r++,t>>8),o(this,A).setUint8(r++,t);break;case 5:o(this,A).setUint8(r++,8|t/2**32&7),o(this,A).setUint8(r++,t>>24),o(this,A).setUint8(r++,t>>16),o(this,A).setUint8(r++,t>>8),o(this,A).setUint8(r++,t);break;case 6:o(this,A).setUint8(r++,4|t/2**40&3),o(this,A).setUint8(r++,t/2**32|0),o(this,A).setUint8(r++,t>>24),o(this,A).setUint8(r++,t>>16),o(this,A).setUint8(r++,t>>8),o(this,A).setUint8(r++,t);break;default:throw new Error("Bad EBML VINT size "+e)}this.write(o(this,ne).subarray(0,r))}writeEBML(t){if(t!==null)if(t instanceof Uint8Array)this.write(t);else if(Array.isArray(t))for(let e of t)this.writeEBML(e);else if(this.offsets.set(t,this.pos),w(this,bt,ar).call(this,t.id),Array.isArray(t.data)){let e=this.pos,r=t.size===-1?1:t.size??4;t.size===-1?w(this,ir,gi).call(this,255):this.seek(this.pos+r);let i=this.pos;if(this.dataOffsets.set(t,i),this.writeEBML(t.data),t.size!==-1){let s=this.pos-i,n=this.pos;this.seek(e),this.writeEBMLVarInt(s,r),this.seek(n)}}else if(typeof t.data=="number"){let e=t.size??mi(t.data);this.writeEBMLVarInt(e),w(this,bt,ar).call(this,t.data,e)}else typeof t.data=="string"?(this.writeEBMLVarInt(t.data.length),w(this,or,yi).call(this,t.data)):t.data instanceof Uint8Array?(this.writeEBMLVarInt(t.data.byteLength,t.size),this.write(t.data)):t.data instanceof fi?(this.writeEBMLVarInt(4),w(this,sr,bi).call(this,t.data.value)):t.data instanceof pr&&(this.writeEBMLVarInt(8),w(this,nr,wi).call(this,t.data.value))}};ne=new WeakMap;A=new WeakMap;ir=new WeakSet;gi=function(t){o(this,A).setUint8(0,t),this.write(o(this,ne).subarray(0,1))};sr=new WeakSet;bi=function(t){o(this,A).setFloat32(0,t,!1),this.write(o(this,ne).subarray(0,4))};nr=new WeakSet;wi=function(t){o(this,A).setFloat64(0,t,!1),this.write(o(this,ne))};bt=new WeakSet;ar=function(t,e=mi(t)){let r=0;switch(e){case 6:o(this,A).setUint8(r++,t/2**40|0);case 5:o(this,A).setUint8(r++,t/2**32|0);case 4:o(this,A).setUint8(r++,t>>24);case 3:o(this,A).setUint8(r++,t>>16);case 2:o(this,A).setUint8(r++,t>>8);case 1:o(this,A).setUint8(r++,t);break;default:throw new Error("Bad UINT size "+e)}this.write(o(this,ne).subarray(0,r))};or=new WeakSet;yi=function(t){this.write(new Uint8Array(t.split("").map(e=>e.charCodeAt(0))))};var wt,we,Qe,yt,lr,Fs=class extends vi{constructor(t){super(),b(this,yt),b(this,wt,void 0),b(this,we,new ArrayBuffer(2**16)),b(this,Qe,new Uint8Array(o(this,we))),S(this,wt,t)}write(t){w(this,yt,lr).call(this,this.pos+t.byteLength),o(this,Qe).set(t,this.pos),this.pos+=t.byteLength}finalize(){w(this,yt,lr).call(this,this.pos),o(this,wt).buffer=o(this,we).slice(0,this.pos)}};wt=new WeakMap;we=new WeakMap;Qe=new WeakMap;yt=new WeakSet;lr=function(t){let e=o(this,we).byteLength;for(;e<t;)e*=2;if(e===o(this,we).byteLength)return;let r=new ArrayBuffer(e),i=new Uint8Array(r);i.set(o(this,Qe),0),S(this,we,r),S(this,Qe,i)};var Se,q,K,fe,it=class extends vi{constructor(t){super(),this.target=t,b(this,Se,!1),b(this,q,void 0),b(this,K,void 0),b(this,fe,void 0)}write(t){if(!o(this,Se))return;let e=this.pos;if(e<o(this,K)){if(e+t.byteLength<=o(this,K))return;t=t.subarray(o(this,K)-e),e=0}let r=e+t.byteLength-o(this,K),i=o(this,q).byteLength;for(;i<r;)i*=2;if(i!==o(this,q).byteLength){let s=new Uint8Array(i);s.set(o(this,q),0),S(this,q,s)}o(this,q).set(t,e-o(this,K)),S(this,fe,Math.max(o(this,fe),e+t.byteLength))}startTrackingWrites(){S(this,Se,!0),S(this,q,new Uint8Array(2**10)),S(this,K,this.pos),S(this,fe,this.pos)}getTrackedWrites(){if(!o(this,Se))throw new Error("Can't get tracked writes since nothing was tracked.");let e={data:o(this,q).subarray(0,o(this,fe)-o(this,K)),start:o(this,K),end:o(this,fe)};return S(this,q,void 0),S(this,Se,!1),e}};Se=new WeakMap;q=new WeakMap;K=new WeakMap;fe=new WeakMap;var Os=2**24,Ds=2,me,Me,De,Ve,te,G,St,cr,br,ki,wr,xi,He,Et,yr=class extends it{constructor(t,e){super(t),b(this,St),b(this,br),b(this,wr),b(this,He),b(this,me,[]),b(this,Me,0),b(this,De,void 0),b(this,Ve,void 0),b(this,te,void 0),b(this,G,[]),S(this,De,e),S(this,Ve,t.options?.chunked??!1),S(this,te,t.options?.chunkSize??Os)}write(t){super.write(t),o(this,me).push({data:t.slice(),start:this.pos}),this.pos+=t.byteLength}flush(){if(o(this,me).length===0)return;let t=[],e=[...o(this,me)].sort((r,i)=>r.start-i.start);t.push({start:e[0].start,size:e[0].data.byteLength});for(let r=1;r<e.length;r++){let i=t[t.length-1],s=e[r];s.start<=i.start+i.size?i.size=Math.max(i.size,s.start+s.data.byteLength-i.start):t.push({start:s.start,size:s.data.byteLength})}for(let r of t){r.data=new Uint8Array(r.size);for(let i of o(this,me))r.start<=i.start&&i.start<r.start+r.size&&r.data.set(i.data,i.start-r.start);if(o(this,Ve))w(this,St,cr).call(this,r.data,r.start),w(this,He,Et).call(this);else{if(o(this,De)&&r.start<o(this,Me))throw new Error("Internal error: Monotonicity violation.");this.target.options.onData?.(r.data,r.start),S(this,Me,r.start+r.data.byteLength)}}o(this,me).length=0}finalize(){o(this,Ve)&&w(this,He,Et).call(this,!0)}};me=new WeakMap;Me=new WeakMap;De=new WeakMap;Ve=new WeakMap;te=new WeakMap;G=new WeakMap;St=new WeakSet;cr=function(t,e){let r=o(this,G).findIndex(l=>l.start<=e&&e<l.start+o(this,te));r===-1&&(r=w(this,wr,xi).call(this,e));let i=o(this,G)[r],s=e-i.start,n=t.subarray(0,Math.min(o(this,te)-s,t.byteLength));i.data.set(n,s);let a={start:s,end:s+n.byteLength};if(w(this,br,ki).call(this,i,a),i.written[0].start===0&&i.written[0].end===o(this,te)&&(i.shouldFlush=!0),o(this,G).length>Ds){for(let l=0;l<o(this,G).length-1;l++)o(this,G)[l].shouldFlush=!0;w(this,He,Et).call(this)}n.byteLength<t.byteLength&&w(this,St,cr).call(this,t.subarray(n.byteLength),e+n.byteLength)};br=new WeakSet;ki=function(t,e){let r=0,i=t.written.length-1,s=-1;for(;r<=i;){let n=Math.floor(r+(i-r+1)/2);t.written[n].start<=e.start?(r=n+1,s=n):i=n-1}for(t.written.splice(s+1,0,e),(s===-1||t.written[s].end<e.start)&&s++;s<t.written.length-1&&t.written[s].end>=t.written[s+1].start;)t.written[s].end=Math.max(t.written[s].end,t.written[s+1].end),t.written.splice(s+1,1)};wr=new WeakSet;xi=function(t){let r={start:Math.floor(t/o(this,te))*o(this,te),data:new Uint8Array(o(this,te)),written:[],shouldFlush:!1};return o(this,G).push(r),o(this,G).sort((i,s)=>i.start-s.start),o(this,G).indexOf(r)};He=new WeakSet;Et=function(t=!1){for(let e=0;e<o(this,G).length;e++){let r=o(this,G)[e];if(!(!r.shouldFlush&&!t)){for(let i of r.written){if(o(this,De)&&r.start+i.start<o(this,Me))throw new Error("Internal error: Monotonicity violation.");this.target.options.onData?.(r.data.subarray(i.start,i.end),r.start+i.start),S(this,Me,r.start+i.end)}o(this,G).splice(e--,1)}}};var Hs=class extends yr{constructor(t,e){super(new pi({onData:(r,i)=>t.stream.write({type:"write",data:r,position:i}),chunked:!0,chunkSize:t.options?.chunkSize}),e)}},Ce=1,Ze=2,_t=3,js=1,qs=2,Ks=17,Ys=2**15,je=2**13,di="webm-muxer",Si=6,Ei=5,Xs=["strict","offset","permissive"],k,y,Je,et,ee,Re,Ee,ye,$e,ae,Ae,Pe,X,st,Le,ie,se,pe,qe,Ke,Ue,Be,Tt,tt,Ye,ur,_i,hr,Ti,vr,Mi,kr,Ai,xr,Pi,Sr,Li,Er,Ui,Lt,_r,Ut,Tr,Mr,Bi,ge,_e,be,Te,dr,zi,fr,Ci,Ge,vt,Fe,kt,Ar,Ri,Y,J,ze,rt,Xe,Mt,Pr,$i,At,Lr,Oe,xt,Ii=class{constructor(t){b(this,ur),b(this,hr),b(this,vr),b(this,kr),b(this,xr),b(this,Sr),b(this,Er),b(this,Lt),b(this,Ut),b(this,Mr),b(this,ge),b(this,be),b(this,dr),b(this,fr),b(this,Ge),b(this,Fe),b(this,Ar),b(this,Y),b(this,ze),b(this,Xe),b(this,Pr),b(this,At),b(this,Oe),b(this,k,void 0),b(this,y,void 0),b(this,Je,void 0),b(this,et,void 0),b(this,ee,void 0),b(this,Re,void 0),b(this,Ee,void 0),b(this,ye,void 0),b(this,$e,void 0),b(this,ae,void 0),b(this,Ae,void 0),b(this,Pe,void 0),b(this,X,void 0),b(this,st,void 0),b(this,Le,0),b(this,ie,[]),b(this,se,[]),b(this,pe,[]),b(this,qe,void 0),b(this,Ke,void 0),b(this,Ue,-1),b(this,Be,-1),b(this,Tt,-1),b(this,tt,void 0),b(this,Ye,!1),w(this,ur,_i).call(this,t),S(this,k,{type:"webm",firstTimestampBehavior:"strict",...t}),this.target=t.target;let e=!!o(this,k).streaming;if(t.target instanceof gr)S(this,y,new Fs(t.target));else if(t.target instanceof pi)S(this,y,new yr(t.target,e));else if(t.target instanceof Gs)S(this,y,new Hs(t.target,e));else throw new Error(`Invalid target: ${t.target}`);w(this,hr,Ti).call(this)}addVideoChunk(t,e,r){if(!(t instanceof EncodedVideoChunk))throw new TypeError("addVideoChunk's first argument (chunk) must be of type EncodedVideoChunk.");if(e&&typeof e!="object")throw new TypeError("addVideoChunk's second argument (meta), when provided, must be an object.");if(r!==void 0&&(!Number.isFinite(r)||r<0))throw new TypeError("addVideoChunk's third argument (timestamp), when provided, must be a non-negative real number.");let i=new Uint8Array(t.byteLength);t.copyTo(i),this.addVideoChunkRaw(i,t.type,r??t.timestamp,e)}addVideoChunkRaw(t,e,r,i){if(!(t instanceof Uint8Array))throw new TypeError("addVideoChunkRaw's first argument (data) must be an instance of Uint8Array.");if(e!=="key"&&e!=="delta")throw new TypeError("addVideoChunkRaw's second argument (type) must be either 'key' or 'delta'.");if(!Number.isFinite(r)||r<0)throw new TypeError("addVideoChunkRaw's third argument (timestamp) must be a non-negative real number.");if(i&&typeof i!="object")throw new TypeError("addVideoChunkRaw's fourth argument (meta), when provided, must be an object.");if(w(this,Oe,xt).call(this),!o(this,k).video)throw new Error("No video track declared.");o(this,qe)===void 0&&S(this,qe,r),i&&w(this,dr,zi).call(this,i);let s=w(this,Fe,kt).call(this,t,e,r,Ce);for(o(this,k).video.codec==="V_VP9"&&w(this,fr,Ci).call(this,s),S(this,Ue,s.timestamp);o(this,se).length>0&&o(this,se)[0].timestamp<=s.timestamp;){let n=o(this,se).shift();w(this,Y,J).call(this,n,!1)}!o(this,k).audio||s.timestamp<=o(this,Be)?w(this,Y,J).call(this,s,!0):o(this,ie).push(s),w(this,Ge,vt).call(this),w(this,ge,_e).call(this)}addAudioChunk(t,e,r){if(!(t instanceof EncodedAudioChunk))throw new TypeError("addAudioChunk's first argument (chunk) must be of type EncodedAudioChunk.");if(e&&typeof e!="object")throw new TypeError("addAudioChunk's second argument (meta), when provided, must be an object.");if(r!==void 0&&(!Number.isFinite(r)||r<0))throw new TypeError("addAudioChunk's third argument (timestamp), when provided, must be a non-negative real number.");let i=new Uint8Array(t.byteLength);t.copyTo(i),this.addAudioChunkRaw(i,t.type,r??t.timestamp,e)}addAudioChunkRaw(t,e,r,i){if(!(t instanceof Uint8Array))throw new TypeError("addAudioChunkRaw's first argument (data) must be an instance of Uint8Array.");if(e!=="key"&&e!=="delta")throw new TypeError("addAudioChunkRaw's second argument (type) must be either 'key' or 'delta'.");if(!Number.isFinite(r)||r<0)throw new TypeError("addAudioChunkRaw's third argument (timestamp) must be a non-negative real number.");if(i&&typeof i!="object")throw new TypeError("addAudioChunkRaw's fourth argument (meta), when provided, must be an object.");if(w(this,Oe,xt).call(this),!o(this,k).audio)throw new Error("No audio track declared.");o(this,Ke)===void 0&&S(this,Ke,r),i?.decoderConfig&&(o(this,k).streaming?S(this,ae,w(this,ze,rt).call(this,i.decoderConfig.description)):w(this,Xe,Mt).call(this,o(this,ae),i.decoderConfig.description));let s=w(this,Fe,kt).call(this,t,e,r,Ze);for(S(this,Be,s.timestamp);o(this,ie).length>0&&o(this,ie)[0].timestamp<=s.timestamp;){let n=o(this,ie).shift();w(this,Y,J).call(this,n,!0)}!o(this,k).video||s.timestamp<=o(this,Ue)?w(this,Y,J).call(this,s,!o(this,k).video):o(this,se).push(s),w(this,Ge,vt).call(this),w(this,ge,_e).call(this)}addSubtitleChunk(t,e,r){if(typeof t!="object"||!t)throw new TypeError("addSubtitleChunk's first argument (chunk) must be an object.");if(!(t.body instanceof Uint8Array))throw new TypeError("body must be an instance of Uint8Array.");if(!Number.isFinite(t.timestamp)||t.timestamp<0)throw new TypeError("timestamp must be a non-negative real number.");if(!Number.isFinite(t.duration)||t.duration<0)throw new TypeError("duration must be a non-negative real number.");if(t.additions&&!(t.additions instanceof Uint8Array))throw new TypeError("additions, when present, must be an instance of Uint8Array.");if(typeof e!="object")throw new TypeError("addSubtitleChunk's second argument (meta) must be an object.");if(w(this,Oe,xt).call(this),!o(this,k).subtitles)throw new Error("No subtitle track declared.");e?.decoderConfig&&(o(this,k).streaming?S(this,Ae,w(this,ze,rt).call(this,e.decoderConfig.description)):w(this,Xe,Mt).call(this,o(this,Ae),e.decoderConfig.description));let i=w(this,Fe,kt).call(this,t.body,"key",r??t.timestamp,_t,t.duration,t.additions);S(this,Tt,i.timestamp),o(this,pe).push(i),w(this,Ge,vt).call(this),w(this,ge,_e).call(this)}finalize(){if(o(this,Ye))throw new Error("Cannot finalize a muxer more than once.");for(;o(this,ie).length>0;)w(this,Y,J).call(this,o(this,ie).shift(),!0);for(;o(this,se).length>0;)w(this,Y,J).call(this,o(this,se).shift(),!0);for(;o(this,pe).length>0&&o(this,pe)[0].timestamp<=o(this,Le);)w(this,Y,J).call(this,o(this,pe).shift(),!1);if(o(this,X)&&w(this,At,Lr).call(this),o(this,y).writeEBML(o(this,Pe)),!o(this,k).streaming){let t=o(this,y).pos,e=o(this,y).pos-o(this,be,Te);o(this,y).seek(o(this,y).offsets.get(o(this,Je))+4),o(this,y).writeEBMLVarInt(e,Si),o(this,Ee).data=new pr(o(this,Le)),o(this,y).seek(o(this,y).offsets.get(o(this,Ee))),o(this,y).writeEBML(o(this,Ee)),o(this,ee).data[0].data[1].data=o(this,y).offsets.get(o(this,Pe))-o(this,be,Te),o(this,ee).data[1].data[1].data=o(this,y).offsets.get(o(this,et))-o(this,be,Te),o(this,ee).data[2].data[1].data=o(this,y).offsets.get(o(this,Re))-o(this,be,Te),o(this,y).seek(o(this,y).offsets.get(o(this,ee))),o(this,y).writeEBML(o(this,ee)),o(this,y).seek(t)}w(this,ge,_e).call(this),o(this,y).finalize(),S(this,Ye,!0)}};k=new WeakMap;y=new WeakMap;Je=new WeakMap;et=new WeakMap;ee=new WeakMap;Re=new WeakMap;Ee=new WeakMap;ye=new WeakMap;$e=new WeakMap;ae=new WeakMap;Ae=new WeakMap;Pe=new WeakMap;X=new WeakMap;st=new WeakMap;Le=new WeakMap;ie=new WeakMap;se=new WeakMap;pe=new WeakMap;qe=new WeakMap;Ke=new WeakMap;Ue=new WeakMap;Be=new WeakMap;Tt=new WeakMap;tt=new WeakMap;Ye=new WeakMap;ur=new WeakSet;_i=function(t){if(typeof t!="object")throw new TypeError("The muxer requires an options object to be passed to its constructor.");if(!(t.target instanceof Pt))throw new TypeError("The target must be provided and an instance of Target.");if(t.video){if(typeof t.video.codec!="string")throw new TypeError(`Invalid video codec: ${t.video.codec}. Must be a string.`);if(!Number.isInteger(t.video.width)||t.video.width<=0)throw new TypeError(`Invalid video width: ${t.video.width}. Must be a positive integer.`);if(!Number.isInteger(t.video.height)||t.video.height<=0)throw new TypeError(`Invalid video height: ${t.video.height}. Must be a positive integer.`);if(t.video.frameRate!==void 0&&(!Number.isFinite(t.video.frameRate)||t.video.frameRate<=0))throw new TypeError(`Invalid video frame rate: ${t.video.frameRate}. Must be a positive number.`);if(t.video.alpha!==void 0&&typeof t.video.alpha!="boolean")throw new TypeError(`Invalid video alpha: ${t.video.alpha}. Must be a boolean.`)}if(t.audio){if(typeof t.audio.codec!="string")throw new TypeError(`Invalid audio codec: ${t.audio.codec}. Must be a string.`);if(!Number.isInteger(t.audio.numberOfChannels)||t.audio.numberOfChannels<=0)throw new TypeError(`Invalid number of audio channels: ${t.audio.numberOfChannels}. Must be a positive integer.`);if(!Number.isInteger(t.audio.sampleRate)||t.audio.sampleRate<=0)throw new TypeError(`Invalid audio sample rate: ${t.audio.sampleRate}. Must be a positive integer.`);if(t.audio.bitDepth!==void 0&&(!Number.isInteger(t.audio.bitDepth)||t.audio.bitDepth<=0))throw new TypeError(`Invalid audio bit depth: ${t.audio.bitDepth}. Must be a positive integer.`)}if(t.subtitles&&typeof t.subtitles.codec!="string")throw new TypeError(`Invalid subtitles codec: ${t.subtitles.codec}. Must be a string.`);if(t.type!==void 0&&!["webm","matroska"].includes(t.type))throw new TypeError(`Invalid type: ${t.type}. Must be 'webm' or 'matroska'.`);if(t.firstTimestampBehavior&&!Xs.includes(t.firstTimestampBehavior))throw new TypeError(`Invalid first timestamp behavior: ${t.firstTimestampBehavior}`);if(t.streaming!==void 0&&typeof t.streaming!="boolean")throw new TypeError(`Invalid streaming option: ${t.streaming}. Must be a boolean.`)};hr=new WeakSet;Ti=function(){o(this,y)instanceof it&&o(this,y).target.options.onHeader&&o(this,y).startTrackingWrites(),w(this,vr,Mi).call(this),o(this,k).streaming||w(this,Sr,Li).call(this),w(this,Er,Ui).call(this),w(this,kr,Ai).call(this),w(this,xr,Pi).call(this),o(this,k).streaming||(w(this,Lt,_r).call(this),w(this,Ut,Tr).call(this)),w(this,Mr,Bi).call(this),w(this,ge,_e).call(this)};vr=new WeakSet;Mi=function(){let t={id:440786851,data:[{id:17030,data:1},{id:17143,data:1},{id:17138,data:4},{id:17139,data:8},{id:17026,data:o(this,k).type??"webm"},{id:17031,data:2},{id:17029,data:2}]};o(this,y).writeEBML(t)};kr=new WeakSet;Ai=function(){S(this,$e,{id:236,size:4,data:new Uint8Array(je)}),S(this,ae,{id:236,size:4,data:new Uint8Array(je)}),S(this,Ae,{id:236,size:4,data:new Uint8Array(je)})};xr=new WeakSet;Pi=function(){S(this,ye,{id:21936,data:[{id:21937,data:2},{id:21946,data:2},{id:21947,data:2},{id:21945,data:0}]})};Sr=new WeakSet;Li=function(){let t=new Uint8Array([28,83,187,107]),e=new Uint8Array([21,73,169,102]),r=new Uint8Array([22,84,174,107]);S(this,ee,{id:290298740,data:[{id:19899,data:[{id:21419,data:t},{id:21420,size:5,data:0}]},{id:19899,data:[{id:21419,data:e},{id:21420,size:5,data:0}]},{id:19899,data:[{id:21419,data:r},{id:21420,size:5,data:0}]}]})};Er=new WeakSet;Ui=function(){let t={id:17545,data:new pr(0)};S(this,Ee,t);let e={id:357149030,data:[{id:2807729,data:1e6},{id:19840,data:di},{id:22337,data:di},o(this,k).streaming?null:t]};S(this,et,e)};Lt=new WeakSet;_r=function(){let t={id:374648427,data:[]};S(this,Re,t),o(this,k).video&&t.data.push({id:174,data:[{id:215,data:Ce},{id:29637,data:Ce},{id:131,data:js},{id:134,data:o(this,k).video.codec},o(this,$e),o(this,k).video.frameRate?{id:2352003,data:1e9/o(this,k).video.frameRate}:null,{id:224,data:[{id:176,data:o(this,k).video.width},{id:186,data:o(this,k).video.height},o(this,k).video.alpha?{id:21440,data:1}:null,o(this,ye)]}]}),o(this,k).audio&&(S(this,ae,o(this,k).streaming?o(this,ae)||null:{id:236,size:4,data:new Uint8Array(je)}),t.data.push({id:174,data:[{id:215,data:Ze},{id:29637,data:Ze},{id:131,data:qs},{id:134,data:o(this,k).audio.codec},o(this,ae),{id:225,data:[{id:181,data:new fi(o(this,k).audio.sampleRate)},{id:159,data:o(this,k).audio.numberOfChannels},o(this,k).audio.bitDepth?{id:25188,data:o(this,k).audio.bitDepth}:null]}]})),o(this,k).subtitles&&t.data.push({id:174,data:[{id:215,data:_t},{id:29637,data:_t},{id:131,data:Ks},{id:134,data:o(this,k).subtitles.codec},o(this,Ae)]})};Ut=new WeakSet;Tr=function(){let t={id:408125543,size:o(this,k).streaming?-1:Si,data:[o(this,k).streaming?null:o(this,ee),o(this,et),o(this,Re)]};if(S(this,Je,t),o(this,y).writeEBML(t),o(this,y)instanceof it&&o(this,y).target.options.onHeader){let{data:e,start:r}=o(this,y).getTrackedWrites();o(this,y).target.options.onHeader(e,r)}};Mr=new WeakSet;Bi=function(){S(this,Pe,{id:475249515,data:[]})};ge=new WeakSet;_e=function(){o(this,y)instanceof yr&&o(this,y).flush()};be=new WeakSet;Te=function(){return o(this,y).dataOffsets.get(o(this,Je))};dr=new WeakSet;zi=function(t){if(t.decoderConfig){if(t.decoderConfig.colorSpace){let e=t.decoderConfig.colorSpace;if(S(this,tt,e),o(this,ye).data=[{id:21937,data:{rgb:1,bt709:1,bt470bg:5,smpte170m:6}[e.matrix]},{id:21946,data:{bt709:1,smpte170m:6,"iec61966-2-1":13}[e.transfer]},{id:21947,data:{bt709:1,bt470bg:5,smpte170m:6}[e.primaries]},{id:21945,data:[1,2][Number(e.fullRange)]}],!o(this,k).streaming){let r=o(this,y).pos;o(this,y).seek(o(this,y).offsets.get(o(this,ye))),o(this,y).writeEBML(o(this,ye)),o(this,y).seek(r)}}t.decoderConfig.description&&(o(this,k).streaming?S(this,$e,w(this,ze,rt).call(this,t.decoderConfig.description)):w(this,Xe,Mt).call(this,o(this,$e),t.decoderConfig.description))}};fr=new WeakSet;Ci=function(t){if(t.type!=="key"||!o(this,tt))return;let e=0;if(xe(t.data,0,2)!==2)return;e+=2;let r=(xe(t.data,e+1,e+2)<<1)+xe(t.data,e+0,e+1);e+=2,r===3&&e++;let i=xe(t.data,e+0,e+1);if(e++,i)return;let s=xe(t.data,e+0,e+1);if(e++,s!==0)return;e+=2;let n=xe(t.data,e+0,e+24);if(e+=24,n!==4817730)return;r>=2&&e++;let a={rgb:7,bt709:2,bt470bg:1,smpte170m:3}[o(this,tt).matrix];Vs(t.data,e+0,e+3,a)};Ge=new WeakSet;vt=function(){let t=Math.min(o(this,k).video?o(this,Ue):1/0,o(this,k).audio?o(this,Be):1/0),e=o(this,pe);for(;e.length>0&&e[0].timestamp<=t;)w(this,Y,J).call(this,e.shift(),!o(this,k).video&&!o(this,k).audio)};Fe=new WeakSet;kt=function(t,e,r,i,s,n){let a=w(this,Ar,Ri).call(this,r,i);return{data:t,additions:n,type:e,timestamp:a,duration:s,trackNumber:i}};Ar=new WeakSet;Ri=function(t,e){let r=e===Ce?o(this,Ue):e===Ze?o(this,Be):o(this,Tt);if(e!==_t){let i=e===Ce?o(this,qe):o(this,Ke);if(o(this,k).firstTimestampBehavior==="strict"&&r===-1&&t!==0)throw new Error(`The first chunk for your media track must have a timestamp of 0 (received ${t}). Non-zero first timestamps are often caused by directly piping frames or audio data from a MediaStreamTrack into the encoder. Their timestamps are typically relative to the age of the document, which is probably what you want.

If you want to offset all timestamps of a track such that the first one is zero, set firstTimestampBehavior: 'offset' in the options.
If you want to allow non-zero first timestamps, set firstTimestampBehavior: 'permissive'.
`);o(this,k).firstTimestampBehavior==="offset"&&(t-=i)}if(t<r)throw new Error(`Timestamps must be monotonically increasing (went from ${r} to ${t}).`);if(t<0)throw new Error(`Timestamps must be non-negative (received ${t}).`);return t};Y=new WeakSet;J=function(t,e){o(this,k).streaming&&!o(this,Re)&&(w(this,Lt,_r).call(this),w(this,Ut,Tr).call(this));let r=Math.floor(t.timestamp/1e3),i=r-o(this,st),s=e&&t.type==="key"&&i>=1e3,n=i>=Ys;if((!o(this,X)||s||n)&&(w(this,Pr,$i).call(this,r),i=0),i<0)return;let a=new Uint8Array(4),l=new DataView(a.buffer);if(l.setUint8(0,128|t.trackNumber),l.setInt16(1,i,!1),t.duration===void 0&&!t.additions){l.setUint8(3,+(t.type==="key")<<7);let c={id:163,data:[a,t.data]};o(this,y).writeEBML(c)}else{let c=Math.floor(t.duration/1e3),u={id:160,data:[{id:161,data:[a,t.data]},t.duration!==void 0?{id:155,data:c}:null,t.additions?{id:30113,data:t.additions}:null]};o(this,y).writeEBML(u)}S(this,Le,Math.max(o(this,Le),r))};ze=new WeakSet;rt=function(t){return{id:25506,size:4,data:new Uint8Array(t)}};Xe=new WeakSet;Mt=function(t,e){let r=o(this,y).pos;o(this,y).seek(o(this,y).offsets.get(t));let i=6+e.byteLength,s=je-i;if(s<0){let n=e.byteLength+s;e instanceof ArrayBuffer?e=e.slice(0,n):e=e.buffer.slice(0,n),s=0}t=[w(this,ze,rt).call(this,e),{id:236,size:4,data:new Uint8Array(s)}],o(this,y).writeEBML(t),o(this,y).seek(r)};Pr=new WeakSet;$i=function(t){o(this,X)&&w(this,At,Lr).call(this),o(this,y)instanceof it&&o(this,y).target.options.onCluster&&o(this,y).startTrackingWrites(),S(this,X,{id:524531317,size:o(this,k).streaming?-1:Ei,data:[{id:231,data:t}]}),o(this,y).writeEBML(o(this,X)),S(this,st,t);let e=o(this,y).offsets.get(o(this,X))-o(this,be,Te);o(this,Pe).data.push({id:187,data:[{id:179,data:t},o(this,k).video?{id:183,data:[{id:247,data:Ce},{id:241,data:e}]}:null,o(this,k).audio?{id:183,data:[{id:247,data:Ze},{id:241,data:e}]}:null]})};At=new WeakSet;Lr=function(){if(!o(this,k).streaming){let t=o(this,y).pos-o(this,y).dataOffsets.get(o(this,X)),e=o(this,y).pos;o(this,y).seek(o(this,y).offsets.get(o(this,X))+4),o(this,y).writeEBMLVarInt(t,Ei),o(this,y).seek(e)}if(o(this,y)instanceof it&&o(this,y).target.options.onCluster){let{data:t,start:e}=o(this,y).getTrackedWrites();o(this,y).target.options.onCluster(t,e,o(this,st))}};Oe=new WeakSet;xt=function(){if(o(this,Ye))throw new Error("Cannot add new video or audio chunks after the file has been finalized.")};var Qs=/(?:(\d{2}):)?(\d{2}):(\d{2}).(\d{3})/;var Da=new TextEncoder,Zs,Js,en,tn,rn,sn,nn,an,on;Zs=new WeakMap;Js=new WeakMap;en=new WeakMap;tn=new WeakMap;rn=new WeakMap;sn=new WeakSet;nn=function(t){let e=Qs.exec(t);if(!e)throw new Error("Expected match.");return 3600*1e3*Number(e[1]||"0")+60*1e3*Number(e[2])+1e3*Number(e[3])+Number(e[4])};an=new WeakSet;on=function(t){let e=Math.floor(t/36e5),r=Math.floor(t%(3600*1e3)/(60*1e3)),i=Math.floor(t%(60*1e3)/1e3),s=t%1e3;return e.toString().padStart(2,"0")+":"+r.toString().padStart(2,"0")+":"+i.toString().padStart(2,"0")+"."+s.toString().padStart(3,"0")};var ln=[["vp09.00.40.08","V_VP9"],["vp8","V_VP8"]],Ni=12e6,cn=24;function Wi({canvas:t}){let e=r=>2*Math.max(Math.round(r/2),8);return[e(t.width),e(t.height)]}async function Vi(t,e,r){return new ImageData(await t.stage.pixels(e,r),e,r)}async function Gi(t){let[e,r]=Wi(t),i=new OffscreenCanvas(e,r);return i.getContext("2d").putImageData(await Vi(t,e,r),0,0),i.convertToBlob({type:"image/png"})}async function Fi(t,e){if(!("VideoEncoder"in globalThis))throw new L("This browser encodes no films.");let[r,i]=Wi(t),s=t.smoke.fps*t.speed,[n,a]=await un(r,i,s),l=new gr,c={codec:a,width:r,height:i,frameRate:s},u=new Ii({target:l,video:c}),d=null,m=new VideoEncoder({output:(h,f)=>u.addVideoChunk(h,f),error:h=>d=h});m.configure({codec:n,width:r,height:i,framerate:s,bitrate:Ni});for(let h=0;h<t.smoke.length;h++){h===0?await t.restart():await t.goTo(h);let f=Math.round(1e6*h/s),p=await Vi(t,r,i),g=new VideoFrame(p.data,{format:"RGBA",codedWidth:r,codedHeight:i,timestamp:f,duration:Math.round(1e6/s)});if(m.encode(g,{keyFrame:h%cn===0}),g.close(),d!==null)throw d;e((h+1)/t.smoke.length)}return await m.flush(),u.finalize(),new Blob([l.buffer],{type:"video/webm"})}async function un(t,e,r){for(let i of ln){let s={codec:i[0],width:t,height:e,framerate:r,bitrate:Ni};if((await VideoEncoder.isConfigSupported(s)).supported)return i}throw new L("This browser encodes no WebM films.")}function Ur(t,e,r){let i=e.names.filter(Boolean).join("_"),s=r==="png"?`_${e.smoke.number(Math.max(e.stage.at,0))}`:"";Qr(t,`${e.smoke.name}_${i}${s}.${r}`.replace(/[^\w.-]+/g,"_"))}var re={orbit:"M12 4a8 8 0 1 0 8 8M20 4v5h-5",erase:"M4 15l8.5-8.5 6 6L12 19H8zM9 10l6 6M8 19h12",more:"M12 4v16M4 12h16",less:"M4 12h16",beside:"M4 5h16v14H4zM12 5v14",alive:"M3 12h4l3-7 4 14 3-7h4",picture:"M4 7h4l1.5-2h5L16 7h4v12H4zM12 16.5a3.5 3.5 0 1 0 0-7 3.5 3.5 0 0 0 0 7z",film:"M4 6h11v12H4zM15 10.5l5-3v9l-5-3z",link:"M10 14a4 4 0 0 0 6 0l3-3a4 4 0 0 0-6-6l-1 1M14 10a4 4 0 0 0-6 0l-3 3a4 4 0 0 0 6 6l1-1",home:"M4 11l8-7 8 7M6 10v9h12v-9",help:"M9 9a3 3 0 1 1 4.2 2.7c-.8.4-1.2 1-1.2 1.8v.5M12 17.4v.1",settings:"M4 8h9M17 8h3M4 16h3M11 16h9M15 6v4M9 14v4"},hn=[["orbit","Turn, pan and zoom (1)"],["erase","Erase the painting; it heals (2)"],["more","Brush the second style on (3)"],["less","Brush the second style off (4)"]];function Oi(t){let e=hn.map(([n,a])=>{let l=V(a,re[n],()=>Ie(t,n));return l.id=`tool-${n}`,[n,l]}),r=V("Beside the plain smoke (B)",re.beside,()=>zr(t)),i=V("Goes on while nothing plays (L)",re.alive,()=>Cr(t)),s=()=>{for(let[n,a]of e)a.setAttribute("aria-pressed",String(t.tool===n));r.setAttribute("aria-pressed",String(t.stage.settings.wipe<1)),i.setAttribute("aria-pressed",String(t.isAlive)),t.canvas.dataset.tool=t.tool};return t.addEventListener("change",s),s(),v("div",{id:"tools",role:"toolbar","aria-label":"Tools"},...e.map(([,n])=>n),v("hr"),r,i,V("Frame the smoke (F)",re.home,()=>t.reframe()),v("hr"),V("Save a picture (P)",re.picture,()=>{Rr(t)}),V("Save a film",re.film,()=>{dn(t)}),V("Copy a link to what is seen (C)",re.link,()=>{$r(t)}),V("Settings (H)",re.settings,Br),V("What can be done (?)",re.help,pt))}function Br(){document.body.classList.toggle("bare")}function Ie(t,e){t.tool=e,t.changed()}function zr(t){t.set("wipe",t.stage.settings.wipe<1?2:.5)}function Cr(t){t.isAlive=!t.isAlive,t.changed()}async function Rr(t){try{Ur(await Gi(t),t,"png")}catch(e){R(C(e))}}async function dn(t){let e=t.isAlive;t.pause(),t.isAlive=!1;try{let r=await Fi(t,i=>R(`Filming: ${Math.round(100*i)} %`));Ur(r,t,"webm")}catch(r){R(C(r))}finally{t.isAlive=e}}async function $r(t){let e=ci(t);history.replaceState(null,"",e);try{await navigator.clipboard.writeText(e),R("The link is copied.")}catch{R("The link is in the address bar.")}}var Di="M8 5.5v13l11-6.5z",fn="M8 5.5v13M16 5.5v13",mn="M18 6.5v11L9 12zM6.5 6.5v11",Ir=[.25,.5,1,2];function Hi(t){let e=t.smoke.length-1,r=V("Play (space)",Di,()=>{Nr(t)});r.id="play";let i=v("input",{type:"range",min:0,max:Math.max(e,1),step:1,id:"scrub","aria-label":"Frame"});i.disabled=e<1;let s=v("output",{id:"frame"}),n=v("button",{type:"button",id:"speed",title:"Speed"});n.addEventListener("click",()=>{let c=(Ir.indexOf(t.speed)+1)%Ir.length;t.speed=Ir[c],t.changed()});let a=!1;i.addEventListener("input",async()=>{if(!a){for(a=!0,t.pause();t.stage.at!==Number(i.value);)await t.goTo(Number(i.value));a=!1}});let l=()=>{let c=Math.max(t.stage.at,0);a||(i.value=String(c)),i.style.setProperty("--part",`${100*c/Math.max(e,1)}%`),s.textContent=String(t.smoke.number(c)),n.textContent=`${t.speed}×`,r.querySelector("path").setAttribute("d",t.isPlaying?fn:Di),r.classList.toggle("playing",t.isPlaying)};return t.addEventListener("change",l),t.addEventListener("frame",l),l(),v("div",{id:"transport",role:"group","aria-label":"Play"},V("From the beginning (R)",mn,()=>{t.restart()}),r,i,s,n)}async function Nr(t){t.isPlaying?t.pause():await t.play()}function ji(t){let e={" ":()=>{Nr(t)},r:()=>{t.restart()},f:()=>t.reframe(),b:()=>zr(t),l:()=>Cr(t),p:()=>{Rr(t)},c:()=>{$r(t)},h:Br,n:()=>{pn(t)},"?":pt,1:()=>Ie(t,"orbit"),2:()=>Ie(t,"erase"),3:()=>Ie(t,"more"),4:()=>Ie(t,"less"),"+":()=>t.look(r=>We(r,.9,0,1/0)),"-":()=>t.look(r=>We(r,1.1,0,1/0)),ArrowLeft:r=>Bt(t,r,-1,0),ArrowRight:r=>Bt(t,r,1,0),ArrowUp:r=>Bt(t,r,0,1),ArrowDown:r=>Bt(t,r,0,-1)};document.addEventListener("keydown",r=>{let i=r.target instanceof HTMLInputElement||r.target instanceof HTMLSelectElement,s=document.getElementById("help")?.open??!1;if(r.ctrlKey||r.metaKey||r.altKey||i||s&&r.key!=="?")return;let n=e[r.key.length===1?r.key.toLowerCase():r.key];n!==void 0&&(r.preventDefault(),n(r))})}function Bt(t,e,r,i){e.shiftKey||i!==0?t.look(s=>Zt(s,4*r,4*i)):(t.pause(),t.goTo(t.stage.at+r))}async function pn(t){let{rules:e}=t.show,r=e.findIndex(i=>i.name===t.names[0]);await t.use(e[(r+1)%e.length].name,0)}var gn=[["Paint",[{name:"strength",label:"Colour",low:0,high:1,step:.01,hint:"From white smoke to the colours of the style"},{name:"densityStrength",label:"Density change",low:0,high:1,step:.01,hint:"How much the style thins and thickens the smoke"},{name:"density",label:"Opacity",low:.02,high:20,step:.01,log:!0,unit:"×",hint:"Extinction γ, as a multiple of the style's own"},{name:"steps",label:"Steps a frame",low:0,high:64,step:1,hint:"How long the rule works between two frames; 0 is as in its training"},{name:"patternSpeed",label:"Pattern speed",low:0,high:2,step:.05,unit:"×",hint:"How fast the smoke carries the pattern from frame to frame: 0 stands, 1 goes along, 2 runs ahead"},{name:"detail",label:"Detail",low:1,high:3,step:1,unit:"×",hint:"Parts of a cell that are drawn, as by --refine"},{name:"half",label:"16-bit steps",low:0,high:1,step:1,hint:"Quicker, and a little rounder"},{name:"seed",label:"Seed",low:0,high:99,step:1,hint:"Another seed, another painting of the same style"}]],["Light",[{name:"light",label:"Light",low:0,high:3,step:.05,hint:"0: the smoke glows by itself"},{name:"lightAzimuth",label:"Around",low:-180,high:180,step:1,unit:"°",hint:"Where the light stands"},{name:"lightElevation",label:"Above",low:-90,high:90,step:1,unit:"°",hint:"How high it stands"},{name:"ambient",label:"Shadows",low:0,high:1,step:.01,hint:"How bright shadows are"},{name:"exposure",label:"Exposure",low:-3,high:3,step:.05,unit:" EV",hint:"Brightness of the picture"}]],["Guide",[{name:"guide",label:"Pull",low:0,high:1,step:.01,hint:"How much the pattern follows this direction instead of the smoke's motion"},{name:"guideAzimuth",label:"Around",low:-180,high:180,step:1,unit:"°",hint:"Direction of the pull"},{name:"guideElevation",label:"Up",low:-90,high:90,step:1,unit:"°",hint:"Direction of the pull"}]],["Brush and mix",[{name:"mix",label:"Second style",low:0,high:1,step:.01,hint:"How much of the second style is seen"},{name:"brush",label:"Brush",low:1,high:24,step:.5,unit:" cells",hint:"Radius of the brushes"}]]];function qi(t){let e=v("aside",{id:"panel","aria-label":"Settings"}),r=[];for(let[s,n]of gn){let a=v("details",{open:s!=="Guide"},v("summary",{},s));for(let l of n)l.name==="half"&&!t.gpu.hasHalf||a.append(bn(t,l,r));e.append(a)}let i=()=>r.forEach(s=>s());return t.addEventListener("change",i),i(),e}function bn(t,e,r){let{name:i,label:s,low:n,high:a,step:l,log:c=!1,unit:u="",hint:d}=e,m=v("input",{type:"range",min:c?Math.log(n):n,max:c?Math.log(a):a,step:c?"any":l,"aria-label":s,id:`set-${i}`}),h=v("output",{});m.addEventListener("input",()=>{let g=Number(m.value);t.set(i,c?Number(Math.exp(g).toPrecision(3)):g)});let p=v("label",{class:"slider",title:d,ondblclick:()=>{t.set(i,t.show.settings[i]??t.defaults[i])}},v("span",{},s),h,m);return r.push(()=>{let g=wn(t,i),T=c?Math.log(g):g;Number(m.value)!==T&&(m.value=String(T));let E=Number(m.min),_=(T-E)/(Number(m.max)-E);m.style.setProperty("--part",`${100*Math.min(Math.max(_,0),1)}%`),h.textContent=yn(t,i,g,u),p.classList.toggle("changed",!t.isDefault(i))}),p}function wn(t,e){let[r]=t.stage.layers;return e==="patternSpeed"&&r!==void 0?t.stage.patternSpeed(r):t.stage.settings[e]}function yn(t,e,r,i){if(e==="steps"&&r===0)return`${t.stage.layers[0]?.rule.steps??""} as trained`;let s=t.stage.settings[e]<0&&e==="patternSpeed"?" as trained":"";return`${Number(r.toPrecision(3))}${i}${s}`}var zt=`// How much smoke lies between each place and the light, as \`rendering/light.py\` finds it: layer by
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
`;var Ki=`// Emission and absorption along the rays of a camera, as \`rendering/\` adds them up: samples lie at
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
`;var Yi=`// What is drawn: density, and colour times density, at every cell of the box and one beside it.
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
`;var Sn=["maxBufferSize","maxStorageBufferBindingSize","maxStorageBuffersPerShaderStage","maxTextureDimension3D","maxTextureDimension2D"],En=65535,Ct=class t{constructor(e,r,i){this.device=e;this.name=r;this.hasHalf=i;this.lost=e.lost}device;name;hasHalf;lost;modules=new Map;pipelines=new Map;drawings=new Map;static async open(){if(!("gpu"in navigator))throw new L("This browser has no WebGPU.");let e=await navigator.gpu.requestAdapter({powerPreference:"high-performance"});if(e===null)throw new L("This browser has WebGPU, but finds no GPU that it may use.");let r=e.features.has("shader-f16"),i={};for(let c of Sn)i[c]=e.limits[c];let s=await e.requestDevice({requiredFeatures:r?["shader-f16"]:[],requiredLimits:i}),{vendor:n,architecture:a,description:l}=e.info;return new t(s,l||`${n} ${a}`.trim()||"a GPU",r)}get bindable(){let{maxStorageBufferBindingSize:e,maxBufferSize:r}=this.device.limits;return Math.min(e,r)}requireBindings(e,r){let i=this.device.limits.maxStorageBuffersPerShaderStage;if(!(e<=i))throw new L(`${r}: arrays in ${e} parts of ${nt(this.bindable)}, and this GPU binds at most ${i}: choose a smaller sequence or less detail.`)}buffer(e){let r=typeof e=="number"?e:e.byteLength,i=this.device.createBuffer({size:Math.max(16,Math.ceil(r/4)*4),usage:GPUBufferUsage.STORAGE|GPUBufferUsage.COPY_DST|GPUBufferUsage.COPY_SRC});return typeof e!="number"&&this.write(i,e),i}uniform(e){let r=GPUBufferUsage.UNIFORM|GPUBufferUsage.COPY_DST;return this.device.createBuffer({size:e,usage:r})}write(e,r,i=0){this.device.queue.writeBuffer(e,i,r.buffer,r.byteOffset,r.byteLength)}module(e){let r=this.modules.get(e);return r===void 0&&(r=this.device.createShaderModule({code:e}),this.modules.set(e,r)),r}async prepare(e){await Promise.all(e.map(async([r,i])=>{let s={module:this.module(r),entryPoint:i},n=await this.device.createComputePipelineAsync({layout:"auto",compute:s});this.pipelines.set(`${i}
${r}`,n)}))}compute(e,r){let i=`${r}
${e}`,s=this.pipelines.get(i);if(s===void 0){let n={module:this.module(e),entryPoint:r};s=this.device.createComputePipeline({layout:"auto",compute:n}),this.pipelines.set(i,s)}return s}async prepareRender(e,r,i){let s=await this.device.createRenderPipelineAsync(this.drawing(e,r,i));this.drawings.set(`${r} ${i}
${e}`,s)}render(e,r,i){let s=`${r} ${i}
${e}`,n=this.drawings.get(s);return n===void 0&&(n=this.device.createRenderPipeline(this.drawing(e,r,i)),this.drawings.set(s,n)),n}drawing(e,r,i){let s=this.module(e);return{layout:"auto",vertex:{module:s,entryPoint:"corner"},fragment:{module:s,entryPoint:r,targets:[{format:i}]}}}bound(e,r,i){let s=Object.entries(i).map(([n,a])=>({binding:Number(n),resource:a instanceof GPUBuffer?{buffer:a}:a}));return this.device.createBindGroup({layout:e.getBindGroupLayout(r),entries:s})}submit(e){let r=this.device.createCommandEncoder();e(r),this.device.queue.submit([r.finish()])}async read(e,r=e.size){let i=GPUBufferUsage.COPY_DST|GPUBufferUsage.MAP_READ,s=this.device.createBuffer({size:r,usage:i});this.submit(a=>a.copyBufferToBuffer(e,0,s,0,r)),await s.mapAsync(GPUMapMode.READ);let n=s.getMappedRange().slice(0);return s.destroy(),n}async pixels(e,r){let{width:i,height:s}=e,n=i*r,a=Math.ceil(n/256)*256,l=GPUBufferUsage.COPY_DST|GPUBufferUsage.MAP_READ,c=this.device.createBuffer({size:a*s,usage:l});this.submit(m=>m.copyTextureToBuffer({texture:e},{buffer:c,bytesPerRow:a},{width:i,height:s})),await c.mapAsync(GPUMapMode.READ);let u=new Uint8Array(c.getMappedRange()),d=new Uint8Array(n*s);for(let m=0;m<s;m++)d.set(u.subarray(m*a,m*a+n),m*n);return c.destroy(),d.buffer}};function D(t,e,r,i){let s=t.beginComputePass();if(s.setPipeline(e),r.forEach((n,a)=>s.setBindGroup(a,n)),typeof i=="number"){let n=Math.ceil(i/En)||1;s.dispatchWorkgroups(Math.ceil(i/n),n)}else s.dispatchWorkgroups(...i);s.end()}function nt(t){return`${Number((t/2**20).toPrecision(3))} MiB`}var Xi=`// The smoke of a frame as its file has it: bytes of bricks, made into numbers where they are read.

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
`;var W=class t{constructor(e,r,i){this.count=e;this.width=r;this.each=i}count;width;each;static of(e,r,i,s=0){return new t(r,i,Math.max(Math.floor(e.bindable/Math.max(i,s)),1))}static WHOLE=new t(1,4,1);get parts(){return Math.max(Math.ceil(this.count/this.each),1)}declared(e,{group:r,first:i,element:s,width:n,isWritten:a=!1}){let{parts:l,each:c}=this,u=l===1?"row":`row % ${c}u`,d=n===void 0?u:`(${u}) * ${n} + place`,m=n===void 0?"row: u32":"row: u32, place: u32",h=a?"read_write":"read",f=Array.from({length:l},(M,x)=>`${`@group(${r}) @binding(${i+x})`} var<storage, ${h}> ${e}_${x}: array<${s}>;
`),p=M=>Array.from({length:l},(x,B)=>l-1-B).map(x=>`${x>0?`if (row >= ${x*c}u) `:""}{ ${M(`${e}_${x}[at]`)} }
`).join("  "),g=`{
  let at = ${d};
  `,T=`fn ${e}_at(${m}) -> ${s} ${g}${p(M=>`return ${M};`)}}
`,_=`${`fn set_${e}(${m}, value: ${s}) ${g}`}${p(M=>`${M} = value; return;`)}}
`;return`${f.join("")}${T}${a?_:""}`}},j=class t{constructor(e,r,i){this.gpu=e;this.layout=r;this.buffers=i}gpu;layout;buffers;static empty(e,r,i){let{count:s,each:n,width:a,parts:l}=r;e.requireBindings(l,i);let c=nt(a);U(a<=e.bindable,`${i}: a row of ${c} is more than this GPU binds at once.`);let u=Array.from({length:l},(d,m)=>e.buffer(Math.min(n,s-m*n)*a));return new t(e,r,u)}static of(e,r,i){let s=t.empty(e,W.of(e,r.length,4),i),{each:n}=s.layout;return s.buffers.forEach((a,l)=>e.write(a,r.subarray(l*n,(l+1)*n))),s}bindings(e){return Object.fromEntries(this.buffers.map((r,i)=>[e+i,r]))}clear(){this.gpu.submit(e=>this.buffers.forEach(r=>e.clearBuffer(r)))}async read(){let{count:e,each:r,width:i}=this.layout,s=new Uint8Array(e*i);for(let[n,a]of this.buffers.entries()){let l=Math.min(r,e-n*r)*i;s.set(new Uint8Array(await this.gpu.read(a,l)),n*r*i)}return s.buffer}destroy(){for(let e of this.buffers)e.destroy()}};var Qi=`// Where cells lie: rows of the state by index coordinates, through a map of bricks of 8³ cells.
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
`;var Rt=4294967295,Mn=.01,ve={group:0,first:16,element:"u32"},$t=3;function oe(t){return`${t.declared("place",ve)}${Qi}`}var Wr=class{constructor(e,r){this.lower=e;this.upper=r;this.size=[0,1,2].map(i=>r[i]-e[i]),this.values=new Uint8Array(this.size[0]*this.size[1]*this.size[2])}lower;upper;size;values;at(e,r,i){let[s,n,a]=this.lower;return((e-s)*this.size[1]+(r-n))*this.size[2]+(i-a)}holds(e,r,i){let{lower:s,upper:n}=this;return e>=s[0]&&e<n[0]&&r>=s[1]&&r<n[1]&&i>=s[2]&&i<n[2]}spread(e,r){let{size:i,values:s}=this,n=[i[1]*i[2],i[2],1],a=Uint8Array.from(s,l=>l>0?1:0);for(let l=0;l<3;l++){let c=n[l],u=i[l],d=a.slice();for(let m=0;m<d.length;m++){if(d[m]===0)continue;let h=Math.floor(m/c)%u,f=-Math.min(e,h),p=Math.min(e,u-1-h);for(let g=f;g<=p;g++)a[m+g*c]=1}}for(let l=0;l<s.length;l++)s[l]===0&&a[l]===1&&(s[l]=r)}};function Zi(t,e,r,i,s){let n=t.lower.map(c=>c-i),a=t.upper.map(c=>c+i),l=new Wr(n,a);return s?l.values.fill(1):(An(l,t,e,255*Math.sqrt(Mn*r/t.density)),l.spread(i,1),l.spread($t,2)),Pn(l,t)}function An(t,e,r,i){for(let s=0;s<r.count;s++){let[n,a,l]=[0,1,2].map(c=>8*r.bricks[3*s+c]);for(let c=0;c<512;c++){if(r.planes[512*s+c]<=i)continue;let[u,d,m]=[n+(c>>6),a+(c>>3&7),l+(c&7)];u>=e.lower[0]&&u<e.upper[0]&&d>=e.lower[1]&&d<e.upper[1]&&m>=e.lower[2]&&m<e.upper[2]&&(t.values[t.at(u,d,m)]=1)}}}function Pn(t,e){let r=t.lower.map(p=>Math.floor(p/8)),i=t.upper.map((p,g)=>Math.floor((p-1)/8)+1-r[g]),s=new Uint32Array(i[0]*i[1]*i[2]).fill(Rt),n=[],a=[],l=[],c=[],u=0;for(let p=0;p<i[0];p++)for(let g=0;g<i[1];g++)for(let T=0;T<i[2];T++,u++){let E=[8*(p+r[0]),8*(g+r[1]),8*(T+r[2])];Ln(t,e,E,a.length,l,c)&&(s[u]=a.length,a.push(u),n.push(p+r[0],g+r[1],T+r[2]))}let d=a.length,m=s.length+3*d,h=new Uint32Array(m+512*d+l.length+c.length);h.set(s),h.set(Int32Array.from(n),s.length),h.fill(Rt,m,m+512*d),[l,c].flat().forEach((p,g)=>{h[m+p]=g,h[m+512*d+g]=p});let f=new Int32Array(16);return f.set([...t.lower,l.length,...t.upper,0,...r,d,...i,0]),{cells:l.length,beside:c.length,uniform:f,places:h}}function Ln(t,e,[r,i,s],n,a,l){let c=a.length+l.length;for(let u=0;u<512;u++){let[d,m,h]=[r+(u>>6),i+(u>>3&7),s+(u&7)];if(!t.holds(d,m,h))continue;let f=t.values[t.at(d,m,h)];f===1?a.push(512*n+u):f===2&&d>=e.lower[0]&&d<e.upper[0]&&m>=e.lower[1]&&m<e.upper[1]&&h>=e.lower[2]&&h<e.upper[2]&&l.push(512*n+u)}return a.length+l.length>c}var Ji={group:2,first:16,element:"u32"};function Q(t){return`${t.declared("word",Ji)}${Xi}`}var It=class t{constructor(e,r,i){this.frame=e;this.uniform=r;this.words=i}frame;uniform;words;static upload(e,r,i){let s=r.lower.map(h=>Math.floor(h/8)),n=r.upper.map((h,f)=>Math.floor((h-1)/8)+1-s[f]),a=n[0]*n[1]*n[2],l=new Uint32Array(a+i.planes.length/4);l.fill(Rt,0,a);for(let h=0;h<i.count;h++){let[f,p,g]=[0,1,2].map(T=>i.bricks[3*h+T]-s[T]);l[(f*n[1]+p)*n[2]+g]=h}new Uint8Array(l.buffer).set(i.planes,4*a);let c=new ArrayBuffer(64),u=new Int32Array(c),d=new Float32Array(c);u.set(r.lower),d[3]=r.density,u.set(r.upper,4),d[7]=r.speed,u.set([...s,i.count,...n],8);let m=e.uniform(64);return e.write(m,new Uint8Array(c)),new t(i,m,j.of(e,l,"the smoke"))}bindings(e=!0){return{0:this.uniform,...e?this.words.bindings(Ji.first):{}}}destroy(){this.uniform.destroy(),this.words.destroy()}};var Un=96,is=[[.5,1],[.3,1/4],[.2,1/16]],Bn=is.reduce((t,[e,r])=>t+e/(1+r),0),zn=2**27,Nt="rgba16float",ss={group:1,first:16,element:"vec4f",width:"u32(look.parts * look.parts * look.parts)"},ot={group:1,first:512,element:"f32",width:"u32((smoke.upper.y - smoke.lower.y) * (smoke.upper.z - smoke.lower.z))"};function es(t,e,r,i){let s=`${e.declared("painted",ss)}${r.declared("brushed",ot)}`;return`${oe(t)}${Q(i)}${s}${Yi}`}function ts(t){return`${Q(t)}${Ki}`}var at=class t{constructor(e,r){this.gpu=e;this.smoke=r;this.looks=[0,1].map(()=>e.uniform(32)),this.camera=e.uniform(128),this.sampler=e.device.createSampler({magFilter:"linear",minFilter:"linear"}),this.nothing=this.texture([1,1,1])}gpu;smoke;parts=0;size=[];textures=[];buffers=null;drawn=null;reached=null;blocks=null;thickness=null;depth=null;looks;camera;sampler;nothing;static async create(e,r){let{WHOLE:i}=W;return await Promise.all([e.prepare([[es(i,i,i,i),"volume"],[zt,"gather"],[zt,"sweep"]]),e.prepareRender(ts(i),"march",Nt)]),new t(e,r)}refine(e){e!==this.parts&&(this.release(),this.size=Vr(this.gpu,this.smoke,e),this.parts=e,this.textures=[0,1].map(()=>this.texture(this.size)),this.makeBlocks())}makeBlocks(){let{gpu:e,smoke:r,parts:i}=this,[s,n]=Cn(r,i),a=Math.max(...s.map((h,f)=>n[f]-h))/Un,l=Math.max(Math.round(a),1),c=r.lower.map(h=>Math.floor(h*i/l)-1),u=r.upper.map(h=>Math.floor((h*i-1)/l)+1),d=c.map((h,f)=>u[f]-h+1),m=d.reduce((h,f)=>h*f,1);this.reached=this.texture(d),this.thickness=e.buffer(4*m),this.depth=e.buffer(4*m),this.blocks={first:c,size:d,times:l,slots:e.uniform(256*Math.max(...d))}}texture(e){return this.gpu.device.createTexture({size:e,dimension:"3d",format:"rgba16float",usage:GPUTextureUsage.TEXTURE_BINDING|GPUTextureUsage.STORAGE_BINDING|GPUTextureUsage.COPY_SRC})}draw(e,r,i,s){this.buffers=e;let n=this.nothing;r.forEach((a,l)=>{let c=new ArrayBuffer(32),u=s.isPlain?1:0;new Int32Array(c).set([this.parts,u,l>0?1:0]);let{mixed:d,strength:m,densityStrength:h}=s,f=s.isPlain?0:h;new Float32Array(c).set([d,m,f,a.rule.density],3),this.gpu.write(this.looks[l],new Uint8Array(c)),n=this.drawLayer(e,a,l,i,n)}),this.drawn=n,s.light.strength>0&&this.shine(s)}drawLayer(e,r,i,s,n){let{gpu:a}=this,l=this.textures[i],[c,u]=[r.places,r.painted],d=[c,u,s,e.words];a.requireBindings(d.reduce((p,{layout:g})=>p+g.parts,0),"the picture");let m=es(c.layout,u.layout,s.layout,e.words.layout),h=a.compute(m,"volume"),f=[a.bound(h,0,{0:r.uniform,...c.bindings(ve.first)}),a.bound(h,1,{0:this.looks[i],3:n.createView(),4:l.createView(),...u.bindings(ss.first),...s.bindings(ot.first)}),a.bound(h,2,e.bindings())];return a.submit(p=>D(p,h,f,rs(this.size))),l}shine({light:e,gamma:r}){let{gpu:i,parts:s}=this,[n,a]=["gather","sweep"].map(x=>i.compute(zt,x)),{first:l,size:c,times:u,slots:d}=this.blocks,[,,m]=H(e.azimuth,e.elevation),h=N(Wt(this.smoke,N(m,-1)),1/u),f=h.map(Math.abs).reduce((x,B,z,$)=>B>$[x]?z:x,0),p=[0,1,2].filter(x=>x!==f),g=p.map(x=>h[x]/Math.abs(h[f])),T=.5/Math.abs(h[f])*r/s,E=this.smoke.lower.map(x=>x*s-1),_=new ArrayBuffer(256*c[f]);for(let x=0;x<c[f];x++){let B=new Int32Array(_,256*x,16),z=new Float32Array(_,256*x,16);B.set([...l,f,...c,u,...E,h[f]>0?1:0]),z.set([...g,T],12),B[15]=x}i.write(d,new Uint8Array(_));let M=x=>({buffer:d,offset:256*x,size:64});i.submit(x=>{let B={1:this.drawn.createView(),2:this.thickness};D(x,n,[i.bound(n,0,{0:M(0),...B})],rs(c));let[z,$]=p.map(P=>Math.ceil(c[P]/8));for(let P=0;P<c[f];P++){let O=i.bound(a,0,{0:M(P),2:this.thickness,3:this.depth,4:this.reached.createView()});D(x,a,[O],[z,$,1])}})}take(e,r,i,s,n,[a,l]=[0,1],c=!0){let{gpu:u,parts:d}=this,m=r.width/r.height,h=2*Z(i.fieldOfView),[f,p,g]=H(i.azimuth,i.elevation),T=ue=>Wt(this.smoke,ue),{light:E}=s,_=Math.max(1-E.strength,0),M=this.blocks,x=M.first.map((ue,Bs)=>(ue+.5)*M.times-.5-this.smoke.lower[Bs]*d+1),B=new Float32Array([...this.place(mt(i)),d,...T(g),n,...T(N(f,h)),m,...T(N(p,h)),s.gamma/d*n,...this.size,0,...x,M.times,_,E.strength,E.ambient,E.strength>0?1:0,...is.map(([ue])=>ue/Bn),0]);u.write(this.camera,B);let z=this.buffers,$=u.render(ts(z.words.layout),"march",Nt),P=e.beginRenderPass({colorAttachments:[{view:r.createView(),loadOp:c?"clear":"load",storeOp:"store",clearValue:[0,0,0,0]}]});P.setPipeline($);let O=u.bound($,0,{0:this.camera,1:this.drawn.createView(),2:this.reached.createView(),3:this.sampler});P.setBindGroup(0,O),P.setBindGroup(1,u.bound($,1,{})),P.setBindGroup(2,u.bound($,2,z.bindings()));let le=Math.round(a*r.width),ce=Math.round(l*r.width)-le;ce>0&&(P.setScissorRect(le,0,ce,r.height),P.draw(3)),P.end()}place(e){return Xt(he(this.smoke.toWorld),e).map((i,s)=>(i+.5)*this.parts-.5-this.smoke.lower[s]*this.parts+1)}get texture3d(){return this.drawn}get cells(){return this.size}get refinement(){return this.parts}release(){for(let e of this.textures)e.destroy();for(let e of[this.reached,this.thickness,this.depth,this.blocks?.slots])e?.destroy()}destroy(){this.release();for(let e of[this.camera,this.nothing,...this.looks])e.destroy()}};function Vr(t,{lower:e,upper:r},i){let s=e.map((l,c)=>(r[c]-l)*i+2),n=t.device.limits.maxTextureDimension3D,a=s.reduce((l,c)=>l*c,1);if(Math.max(...s)>n||a>zn)throw new L(`A volume of ${s.join(" × ")} (${nt(8*a)}) is more than this page draws: choose a smaller sequence or less detail.`);return s}function Wt(t,e){return N(Jr(he(t.toWorld),e),Vt(t))}function Vt(t){return Math.hypot(...[0,1,2].map(e=>t.toWorld[e][0]))}function Cn(t,e){let r=Vt(t)/e,[i,s]=Gr(t,t.toWorld);return[N(i,1/r),N(s,1/r)]}function Gr(t,e){let r=Array.from({length:8},(s,n)=>{let a=[0,1,2].map(l=>(n>>l&1?t.upper:t.lower)[l]-.5);return Xt(e,a)}),i=s=>[0,1,2].map(n=>s(...r.map(a=>a[n])));return[i(Math.min),i(Math.max)]}function rs(t){return t.map(e=>Math.ceil(e/4))}function ns(t){let e=v("div",{id:"ring","aria-hidden":"true"}),{canvas:r}=t,i=()=>{let{camera:n,settings:a}=t.stage,l=2*n.distance*Z(n.fieldOfView),c=2*a.brush*Vt(t.smoke)*r.clientHeight/l;e.style.width=e.style.height=`${c}px`,e.dataset.tool=t.tool};r.addEventListener("pointermove",n=>{e.classList.toggle("shown",t.tool!=="orbit"),e.style.left=`${n.clientX}px`,e.style.top=`${n.clientY}px`});let s=()=>e.classList.remove("shown");return r.addEventListener("pointerleave",s),r.addEventListener("pointerup",n=>{n.pointerType==="touch"&&s()}),t.addEventListener("change",()=>{i(),t.tool==="orbit"&&s()}),i(),e}async function as(){let t;try{t=await(await fetch("show.json",{cache:"no-cache"})).json()}catch{throw new L("show.json is not there or damaged: this page has nothing to show.")}if(!(typeof t=="object"&&t!==null&&Array.isArray(t.rules)&&t.rules.length>0&&t.rules.every(Rn)&&Fr(t.smoke)&&typeof t.title=="string"&&typeof t.settings=="object"&&t.settings!==null))throw new L("show.json is damaged: this page has nothing to show.");return t}function Rn(t){return typeof t?.name=="string"&&Fr(t.model)&&(t.thumbnail===void 0||Fr(t.thumbnail))}function Fr(t){return typeof t=="string"&&/^[\w.-]+(\/[\w.-]+)*$/.test(t)&&!t.includes("..")}async function lt(t){let e=await fetch(t,{cache:"no-cache"});if(!e.ok)throw new L(`${t}: the server says ${e.status}`);return e.arrayBuffer()}var $n=2e3,os=.8,ls=300,Or=64;function cs(t){let e=v("section",{id:"curves","aria-label":"Training"});document.body.append(e);let r="",i=async()=>{try{let s=JSON.parse(new TextDecoder().decode(await lt("run.json")));In(e,s),s.model!==r&&(await t.learned(await lt(t.show.rules[0].model)),r=s.model)}catch{}setTimeout(()=>{i()},$n)};i()}function In(t,{iteration:e,iterations:r,curves:i}){let s=r>0?` of ${r}`:"",n=Object.entries(i).filter(([,a])=>a.length>1).map(([a,l])=>{let c=l[l.length-1][1],u=v("figcaption",{},a,v("output",{},String(Number(c.toPrecision(3)))));return v("figure",{},u,Nn(l))});t.replaceChildren(v("h2",{},`Iteration ${e}${s}`),...n)}function Nn(t){let e=t.filter(([,f])=>Number.isFinite(f)),r=e.every(([,f])=>f>0),i=e.map(([,f])=>r?Math.log(f):f),s=Math.min(...i),n=Math.max(...i)-s||1,a=e[0]?.[0]??0,l=(e[e.length-1]?.[0]??1)-a||1,c=f=>f.map((p,g)=>{let T=ls*(e[g][0]-a)/l;return`${g===0?"M":"L"}${T.toFixed(1)} ${(Or-Or*(p-s)/n).toFixed(1)}`}).join(""),u=i[0]??0,d=i.map(f=>u=os*u+(1-os)*f),m="http://www.w3.org/2000/svg",h=document.createElementNS(m,"svg");h.setAttribute("viewBox",`-2 -2 ${ls+4} ${Or+4}`);for(let[f,p]of[["raw",i],["mean",d]]){let g=document.createElementNS(m,"path");g.setAttribute("d",c(p)),g.setAttribute("class",f),h.append(g)}return h}var Wn=500;function us(t){let e=v("nav",{id:"styles","aria-label":"Styles"}),r=new Map,i=async(c,u)=>{try{let d=u&&t.names[1]===c;await t.use(d?"":c,u?1:0)}catch(d){R(C(d))}},s=0,n=!1,a=()=>{for(let c of t.show.rules){if(r.has(c.name))continue;let u=v("button",{type:"button",title:`${c.title||c.name}. Right click, or hold: mix it with the one that paints`,onclick:d=>{n||i(c.name,d.shiftKey),n=!1},onpointerdown:d=>{n=!1,d.pointerType==="touch"&&(s=window.setTimeout(()=>{n=!0,i(c.name,!0)},Wn))},onpointerup:()=>clearTimeout(s),onpointercancel:()=>clearTimeout(s),oncontextmenu:d=>{d.preventDefault(),n||i(c.name,!0),clearTimeout(s)}});c.thumbnail&&u.append(v("img",{src:c.thumbnail,alt:"",draggable:"false"})),u.append(v("span",{},c.name.replaceAll("_"," "))),r.set(c.name,u),c.model===""?e.prepend(u):e.append(u)}},l=()=>{a();for(let[c,u]of r)u.classList.toggle("first",t.names[0]===c),u.classList.toggle("second",t.names[1]===c),u.setAttribute("aria-pressed",String(t.names.includes(c)))};return t.addEventListener("rules",l),l(),e}var Vn=4,Gn=64*2**20,Ne={channels:64,hidden:1024,units:256,dilation:64,steps:4096,width:16},Dr={position:3,density:1,velocity:3},Fn=["first","second","third","output"];function Gt(t,e){try{return On(t,e)}catch(r){throw r instanceof L?r:new L(`${e}: damaged model`)}}function On(t,e){let r=(P,O)=>U(P,`${e}: ${O}`);r(t.byteLength>=8,"not a model of vnca"),r(t.byteLength<=Gn,"larger than any model of vnca");let i=Number(new DataView(t).getBigUint64(0,!0));r(i<=t.byteLength-8,"not a model of vnca");let s=hs(new TextDecoder().decode(new Uint8Array(t,8,i)),e),n=s?.__metadata__?.vnca;r(typeof n=="string","not a model of vnca");let a=hs(n,e);r(Number.isInteger(a.format_version)&&a.format_version>=1,"damaged model"),r(a.format_version<=Vn,`its format, ${a.format_version}, is newer than this page`);let l=a.rule,c=P=>Hn(t,8+i,s[P],`${e}: ${P}`),u=(P,O,le,ce)=>{let ue=typeof P=="number"&&P>=O&&P<=le;return r(ue,`damaged model (${ce} is not a number from ${O} to ${le})`),P},d=(P,O,le,ce)=>(r(Number.isInteger(P),`damaged model (${ce} is not a whole number)`),u(P,O,le,ce)),m=d(l.channels,4,Ne.channels,"channels"),h=d(l.hidden,1,Ne.hidden,"hidden"),f=a.conditioning??Object.entries(Dr).map(([P,O])=>[P,O]);r(Array.isArray(f),"damaged model");let{columns:p,fields:g,width:T}=Dn(f,l,e),E=l.transport??!1;r(typeof E=="boolean","damaged model (transport is not true or false)");let _=ct(c("hidden"),h,5*m+T,`${e}: hidden`),M=ct(c("bias"),h,1,`${e}: bias`),x=ct(c("output"),m,h,`${e}: output`),{density:B,velocity:z,gamma:$}=a.scales;for(let P of[B,z,$])u(P,1e-30,1e30,"scale");return{name:e,title:String(a.training?.title??a.training?.style??""),channels:m,hidden:_,bias:M,output:x,decoder:jn(s,c,m,e),probability:u(l.update_probability,1e-9,1,"update_probability"),steps:d(l.steps_per_frame,1,Ne.steps,"steps_per_frame"),transport:E,dilation:d(l.dilation??l.reach??1,0,Ne.dilation,"dilation"),wholeBox:l.domain==="box",sobel:u(l.sobel_divisor,1e-9,1e9,"sobel_divisor"),laplacian:u(l.laplacian_divisor,1e-9,1e9,"laplacian_divisor"),columns:p,width:T,fields:g,density:B,speed:z,gamma:$,place:qn(a.place,e)}}function Dn(t,e,r){let i={},s=[],n=0;for(let[a,l,c]of t){let u=typeof a=="string"&&/^\w{1,100}$/.test(a),d=u?a:"something";if(u&&c===void 0&&Dr[a]===l)e[`${a}_prior`]!==!1&&(i[a]=n);else{let m=u&&!(a in Dr)&&Number.isFinite(c)&&c!==0;U(m,`${r}: the rule is conditioned on ${d}, which this page does not have`);let h=Number.isInteger(l)&&l>=1&&l<=Ne.width;U(h,`${r}: damaged model (width of ${d})`),s.push({name:a,width:l,scale:c,column:n})}n+=l}return{columns:i,fields:s,width:n}}function hs(t,e){try{return JSON.parse(t)}catch{throw new L(`${e}: not a model of vnca`)}}function Hn(t,e,r,i){U(r!==void 0,`${i} is missing`),U(r.dtype==="F32",`${i}: expected F32, got ${String(r.dtype)}`);let[s,n=1]=r.shape,[a,l]=r.data_offsets,c=l-a===4*s*n&&a>=0&&e+l<=t.byteLength;U(c&&r.shape.length<=2,`${i}: its place in the file cannot be`);let u=new Float32Array(t.slice(e+a,e+l));return U(u.every(Number.isFinite),`${i}: not all finite`),{values:u,rows:s,columns:n}}function ct(t,e,r,i){let s=t.rows===e&&t.columns===r;return U(s,`${i}: expected ${e} × ${r}, got ${t.rows} × ${t.columns}`),t}function jn(t,e,r,i){if(t["decoder.first"]===void 0)return[];let n=e("decoder.first").rows;return U(n>=1&&n<=Ne.units,`${i}: a decoder of ${n} units`),Fn.map((a,l)=>{let c=a==="output"?4:n,u=`${i}: decoder.${a}`;return{weights:ct(e(`decoder.${a}`),c,l===0?r:n,u),bias:ct(e(`decoder.${a}_bias`),c,1,`${u}_bias`)}})}function qn(t,e){if(t==null)return null;let{lattice_to_world:r,box:i}=t;return U(dt(r)&&ft(i),`${e}: its place cannot be`),{toWorld:r,lower:i[0],upper:i[1]}}var Kn="vncasmk1",Yn=65536,Xn=2**24,Qn=1e5,Zn=2**20,Jn=1100,ea=16,ta=64*2**20,Ft=class t{constructor(e,r,i,s,n,a,l,c,u,d,m){this.url=e;this.name=r;this.fps=i;this.lower=s;this.upper=n;this.toWorld=a;this.density=l;this.speed=c;this.fields=u;this.stored=d;this.begin=m}url;name;fps;lower;upper;toWorld;density;speed;fields;stored;begin;frames=new Map;whole=null;get length(){return this.stored.length}get bytesOfBrick(){let e=this.fields.reduce((r,{width:i})=>r+i,0);return 512*(this.speed>0?4:1)+1024*e}number(e){return this.stored[e].number}static async open(e){let r=e.split("/").pop()??e,{bytes:i,isWhole:s}=await Hr(e,0,Yn);U(i.length>=12,`${r}: not a sequence of vnca`);let n=String.fromCharCode(...i.subarray(0,8));U(n===Kn,`${r}: not a sequence of vnca`);let a=new DataView(i.buffer,i.byteOffset).getUint32(8,!0);U(a<=Xn,`${r}: its header is damaged`),i.length<12+a&&!s&&({bytes:i,isWhole:s}=await Hr(e,0,12+a)),U(i.length>=12+a,`${r}: it ends within its header`);let l;try{let c=new TextDecoder().decode(i.subarray(12,12+a));l=t.described(e,r,JSON.parse(c),12+a)}catch(c){throw c instanceof L?c:new L(`${r}: its header is damaged`)}return s&&(l.whole=i),l}static described(e,r,i,s){let n=(E,_)=>U(E,`${r}: its header is damaged (${_})`);n(ft(i.box),"box");let[a,l]=i.box,{density:c,speed:u,fps:d}=i;n(c>0&&c<1e30&&u>=0&&u<1e30,"scales"),n(d>0&&d<=1e3,"fps");let m=i.lattice_to_world;n(dt(m),"lattice_to_world");let h=i.fields??[];n(Array.isArray(h)&&h.length<=ea,"fields");for(let{name:E,width:_,scale:M}of h){let x=Number.isInteger(_)&&_>=1&&_<=16;n(typeof E=="string"&&x&&M>=0&&M<1e30,"fields")}let f=i.frames;n(Array.isArray(f)&&f.length>=1&&f.length<=Qn,"frames");let p=a.reduce((E,_,M)=>E*(Math.floor((l[M]-1)/8)-Math.floor(_/8)+1),1);for(let{number:E,offset:_,length:M,bricks:x}of f){let B=[_,M,x].every($=>Number.isSafeInteger($)&&$>=0),z=x<=Math.min(p,Zn);n(B&&Number.isSafeInteger(E)&&z,"frames")}let g=String(i.name??r).slice(0,100),T=[a,l];return new t(e,g,d,...T,m,c,u,h,f,s)}frame(e){let r=this.frames.get(e);return r===void 0&&(r=this.read(this.stored[e]),this.frames.set(e,r),r.catch(()=>this.frames.delete(e)),this.forget()),r}forget(){let e=0;for(let r of[...this.frames.keys()].reverse())e+=this.stored[r].bricks*this.bytesOfBrick,e>ta&&this.frames.delete(r)}async read(e){let{number:r,offset:i,length:s,bricks:n}=e,a=`${this.name}, frame ${r}`,l;if(this.whole===null){let{bytes:p,isWhole:g}=await Hr(this.url,this.begin+i,s);g&&(this.whole=p),l=g?p.subarray(this.begin+i,this.begin+i+s):p}else l=this.whole.subarray(this.begin+i,this.begin+i+s);U(l.length===s,`${a}: the file ends before it`);let c=n*(6+this.bytesOfBrick);U(c<=Jn*Math.max(s,1),`${a}: less than it says`);let u=await ra(l,c,a),d=this.lower.map(p=>Math.floor(p/8)),m=this.upper.map(p=>Math.floor((p-1)/8)),h=new DataView(u.buffer),f=new Int32Array(3*n);for(let p=0;p<f.length;p++)f[p]=h.getUint16(2*p,!0)+d[p%3],U(f[p]<=m[p%3],`${a}: a brick lies outside the box`);return{number:r,count:n,bricks:f,planes:u.slice(6*n)}}};async function Hr(t,e,r){let i=`bytes=${e}-${e+Math.max(r,1)-1}`,s=await fetch(t,{headers:{Range:i}});if(s.status!==206&&s.status!==200)throw new L(`${t.split("/").pop()}: the server says ${s.status}`);return{bytes:new Uint8Array(await s.arrayBuffer()),isWhole:s.status===200}}async function ra(t,e,r){let i=new Uint8Array(e),n=new Blob([t]).stream().pipeThrough(new DecompressionStream("deflate")).getReader(),a=0;try{for(;;){let{done:l,value:c}=await n.read();if(l)break;U(a+c.length<=e,`${r}: more than it says`),i.set(c,a),a+=c.length}}catch(l){throw n.cancel().catch(()=>{}),l instanceof L?l:new L(`${r}: damaged`)}return U(a===e,`${r}: less than it says`),i}var ds=`// How much more of the second rule is seen: \`brushed_at\` reads it and \`set_brushed\` writes it.

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
`;var fs=`// Where a ray meets the smoke.

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
`;var ms=.5;function ps(){return`${Q(W.WHOLE)}${ut}${fs}`}function gs(t){let e=t.declared("brushed",{...ot,isWritten:!0});return`${Q(W.WHOLE)}${ut}${e}${ds}`}var Ot=class t{constructor(e,r){this.gpu=e;this.smoke=r;let[i,s,n]=r.lower.map((a,l)=>r.upper[l]-a);this.brushed=j.empty(e,W.of(e,i,4*s*n),"the mix of two rules"),this.uniform=e.uniform(64),this.hit=e.buffer(16)}gpu;smoke;brushed;uniform;hit;static async create(e,r){let i=new t(e,r);return await e.prepare([[ps(),"meet"],[gs(i.brushed.layout),"blend"]]),i}point([e,r],{camera:i,aspect:s,picture:n,gamma:a},l,c){let{gpu:u,smoke:d}=this,[m,h,f]=H(i.azimuth,i.elevation),p=2*Z(i.fieldOfView),g=I(I(f,m,e*s*p),h,r*p),T=Wt(d,N(g,1/Math.hypot(...g))),E=n.refinement,_=l==="less"?-ms:ms;u.write(this.uniform,new Float32Array([...n.place(mt(i)),c,...T,a/E,...n.cells,E,_,0,0,0]));let M=u.compute(ps(),"meet"),x={0:this.uniform,1:n.texture3d.createView(),2:this.hit},B=[u.bound(M,0,{}),u.bound(M,1,x)];u.submit(z=>D(z,M,B,1))}erase(e,r){for(let i of e)i.erase(r,{0:this.uniform,2:this.hit})}blend(e){let{gpu:r,smoke:i,brushed:s}=this,n=r.compute(gs(s.layout),"blend"),a=i.lower.map((c,u)=>Math.ceil((i.upper[u]-c)/4)),l=[r.bound(n,0,{}),r.bound(n,1,{0:this.uniform,2:this.hit,...s.bindings(ot.first)}),r.bound(n,2,e.bindings(!1))];r.submit(c=>D(c,n,l,a))}};function F(t){return Math.ceil(t/4)}function bs(t){let e=t;return e^=e>>>16,e=Math.imul(e,2146121005),e^=e>>>15,e=Math.imul(e,2221713035),e^=e>>>16,e>>>0}function ys(t,e){return bs((t>>>0)+bs(e>>>0)>>>0)}function vs(t){return Math.min(Math.max(Math.round(t*2**32),1),2**32-1)}function ks(t,e){let r=new Float32Array(216),i=[1,2,1];for(let s=0;s<27;s++){let[n,a,l]=[Math.floor(s/9),Math.floor(s/3)%3,s%3],c=Math.abs(n-1)+Math.abs(a-1)+Math.abs(l-1);r.set([c===0?1:0,(n-1)*i[a]*i[l]/t,(a-1)*i[n]*i[l]/t,(l-1)*i[n]*i[a]/t,[-88,6,3,2][c]/e],8*s)}return r}function jr(t,e,r){let{channels:i,hidden:s,bias:n,output:a}=t,l=4*F(i),c=5*l+e+l,u=new Float32Array(s.rows*c);for(let d=0;d<s.rows;d++){let m=s.values.subarray(d*s.columns,(d+1)*s.columns),h=d*c;for(let f=0;f<5;f++){let p=m.subarray(f*i,(f+1)*i);u.set(p,h+f*l)}u.set(m.subarray(5*i),h+5*l),u[h+5*l+e-1]=n.values[d];for(let f=0;f<i;f++){let p=h+5*l+e+f;u[p]=a.values[f*a.columns+d]}}return r?aa(u):u}function qr(t){if(t.decoder.length===0)return new Float32Array(4);let e=4*F(t.decoder[0].weights.rows),r=t.decoder.flatMap(({weights:n,bias:a},l)=>{let c=l<3?e:4;return[ws(n,c,4*F(n.columns)),ws(a,c,1)]}),i=new Float32Array(r.reduce((n,a)=>n+a.length,0)),s=0;for(let n of r)i.set(n,s),s+=n.length;return i}function ws(t,e,r){let i=new Float32Array(e*r);for(let s=0;s<t.rows;s++){let n=t.values.subarray(s*t.columns,(s+1)*t.columns);i.set(n,s*r)}return i}function aa(t){let e=new Uint32Array(t.slice().buffer);return Uint16Array.from(e,r=>{let i=r>>>16&32768,s=r&2147483647;if(s>=1199570944)return i|31744;if(s<855638016)return i;if(s<947912704){let l=126-(s>>>23),c=s&8388607|8388608,u=c>>>l,d=c&(1<<l)-1,m=1<<l-1;return i|u+(d>m||d===m&&u&1?1:0)}let n=s-939524096>>>13,a=s&8191;return i|n+(a>4096||a===4096&&n&1?1:0)})}var xs=`// The state on the cells of another frame, carried there by its velocity: \`painting/transport.py\`.
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
`;var Ss=`// What the cells of a rule are conditioned on: position, density, velocity, as \`rule/conditioning.py\`;
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
`;var Es=`// States made zero where a brush touches the smoke; they begin anew.

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
`;var _s=`// What is seen of a state: the mean over each part of a cell, as \`painting/__init__.py\` paints it.

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
`;var Ts=`// What is seen of a state between cells: its first four channels and what three sine layers add.
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
`;var Ms=`// One step: s' = s + m · W2 relu(W1 [perception ‖ priors ‖ 1]), the bias being W1's last column.
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
`;var ke={group:0,first:512,element:"vec4f",width:"PLANES"},Kr={group:2,first:16,element:"vec4f"},Yr={group:1,first:16,element:"u32"},Dt=class{planes;sizes;factor;fields;constructor(e,r,i){let s=e.decoder.length>0?F(e.decoder[0].weights.rows):0,n=F(e.width+1);this.factor=i?`enable f16;
alias Factor = f16;
`:`alias Factor = f32;
`,this.planes=`const PLANES = ${F(e.channels)}u;
`,this.sizes=`const TOLD = ${n}u;
const HIDDEN = ${e.hidden.rows}u;
const UNITS4 = ${s}u;
`,this.fields=fa(e,r)}step(e,r){let i=`${oe(e)}${r.declared("state",ke)}`;return`${this.factor}${this.planes}${this.sizes}${i}${Ms}`}condition(e,r){return`${oe(e)}${Q(r)}${this.fields}${Ss}`}carry(e,r,i,s){let n=r.declared("wanted_place",Yr),a=i.declared("before",{...ke,group:1});return`${this.planes}${oe(e)}${Q(s)}${n}${a}${xs}`}erase(e,r){return`${this.planes}${oe(e)}${Q(r)}${ut}${Es}`}paint(e,r,i){let n=r.declared("state",{...ke,group:2})+i.declared("painted",{...Kr,width:"(now.parts * now.parts * now.parts)",isWritten:!0});return`${this.planes}${this.sizes}${oe(e)}${n}${Ts}${_s}`}};function fa(t,e){let r=s=>`${Math.fround(s).toExponential()}f`,i=[];for(let{name:s,scale:n,column:a}of t.fields){let l=0;for(let c of e.fields){for(let u=0;c.name===s&&u<c.width;u++){let d=`${r(c.scale)} * field_at(${l+u}u, cell) / ${r(n)}`;i.push(`  told[first + ${a+u}u] = ${d};
`)}l+=c.width}}return`fn tell_fields(first: u32, cell: vec3i) {
${i.join("")}}
`}var Ht=256,As=64,jt=class t{constructor(e,r,i,s){this.gpu=e;this.rule=r;this.smoke=i;this.isHalf=s;let n=4*F(r.width+1);this.programs=new Dt(r,i,s),this.uniform=e.uniform(64),this.steps=e.uniform(Ht*As),this.filters=e.uniform(864),e.write(this.filters,ks(r.sobel,r.laplacian)),this.weights=e.buffer(jr(r,n,s)),this.network=e.buffer(qr(r)),this.given=e.uniform(112),this.wanted=e.uniform(48),this.now=Array.from({length:2+4*$t},()=>e.uniform(32))}gpu;rule;smoke;isHalf;stepsDone=0;uniform;work=null;painting=null;programs;steps;filters;weights;network;given;wanted;now;static async create(e,r,i,s){for(let{name:c,width:u}of r.fields){let d=i.fields.some(m=>m.name===c&&m.width===u);U(d,`${r.name}: the rule is conditioned on ${c}, which this sequence does not have`)}let n=new t(e,r,i,s&&e.hasHalf),{programs:a}=n,{WHOLE:l}=W;return await e.prepare([[a.step(l,l),"step"],[a.condition(l,l),"condition"],[a.carry(l,l,l,l),"carry"],[a.paint(l,l,l),"paint"],[a.paint(l,l,l),"rim"]]),n}get sites(){return this.work?.sites??null}get state(){return this.work?.state??null}get places(){return this.work?.places??null}get painted(){return this.painting}learn(e){let r=i=>JSON.stringify([i.channels,i.hidden,i.columns,i.width,i.dilation,i.decoder.length].map(s=>typeof s=="object"&&"values"in s?[s.rows,s.columns]:s));return r(e)!==r(this.rule)?!1:(this.gpu.write(this.weights,jr(e,4*F(e.width+1),this.isHalf)),this.gpu.write(this.network,qr(e)),this.rule=e,!0)}enter(e,r,i){let{gpu:s,rule:n}=this,a=Zi(this.smoke,e.frame,n.density,n.dilation,n.wholeBox),l=this.prepared(a);this.work!==null&&a.cells>0&&this.carry(e,this.work,l,r,i),this.release(),s.write(this.uniform,a.uniform),this.work=l,this.condition(e,r)}prepared(e){let{gpu:r,rule:i}=this,[s,n]=[16*F(i.channels),16*F(i.width+1)],a=W.of(r,e.cells+1,s,n),l=j.of(r,e.places,"the list of cells");r.requireBindings(l.layout.parts+a.parts+3,"the cells of the smoke");let c=Array.from({length:Math.ceil(e.cells/a.each)},(h,f)=>{let p=r.uniform(16),g=f*a.each;return r.write(p,new Uint32Array([g,Math.min(a.each,e.cells-g)])),p}),u=j.empty(r,new W(e.cells,n,a.each),"the conditioning"),[d,m]=[0,1].map(()=>j.empty(r,a,"the state"));return{sites:e,places:l,told:u,batches:c,state:d,spare:m}}carry(e,r,i,s,n){let{gpu:a}=this,[,,,,,,,,,,,l,c,u,d]=i.sites.uniform,m=new ArrayBuffer(48);new Uint32Array(m).set([c*u*d,l]);let h=new Float32Array(m);h.set([n,...this.alongCells(s.direction),s.amount,this.rule.speed],3),a.write(this.wanted,h);let f=[r.places,i.places,r.state,e.words].map(({layout:x})=>x);a.requireBindings(f.reduce((x,{parts:B})=>x+B,1),"the cells of two frames");let[p,g,T,E]=f,_=a.compute(this.programs.carry(p,g,T,E),"carry"),M={0:this.wanted,...i.places.bindings(Yr.first),...r.state.bindings(ke.first)};this.eachBatch(i,_,r.places,x=>[{...M,3:i.state.buffers[x]},e.bindings()])}eachBatch({batches:e,state:r,sites:i},s,n,a){let{gpu:l}=this,c=Math.min(r.layout.each,i.cells);l.submit(u=>e.forEach((d,m)=>{let f=[{0:this.uniform,1:d,...n.bindings(ve.first)},...a(m)].map((p,g)=>l.bound(s,g,p));D(u,s,f,Math.ceil(c/64))}))}condition(e,r){let{gpu:i,rule:s,work:n}=this;if(n===null||n.sites.cells===0)return;let a=new ArrayBuffer(112),l=new Float32Array(a),c=this.placeMatrix();for(let g=0;g<16;g++)l[g]=c[g%4][g>>2];let{position:u=-1,density:d=-1,velocity:m=-1}=s.columns;new Int32Array(a).set([u,d,m,4*F(s.width+1)],16),l.set([s.density,s.speed],20),l.set([...this.alongCells(r.direction),r.amount],24),i.write(this.given,l);let{places:h,told:f}=n,p=this.programs.condition(h.layout,e.words.layout);this.eachBatch(n,i.compute(p,"condition"),h,g=>[{0:this.given,1:f.buffers[g]},e.bindings()])}alongCells(e){let r=he(this.smoke.toWorld),i=[0,1,2].map(n=>e.reduce((a,l,c)=>a+r[n][c]*l,0)),s=Math.hypot(...i)||1;return i.map(n=>n/s)}placeMatrix(){let{place:e,dilation:r}=this.rule,i=[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]],s=this.smoke.lower.map(a=>a-r),n=this.smoke.upper.map(a=>a+r);if(e!==null){let a=Zr(he(e.toWorld),this.smoke.toWorld);this.isNear(a,e.lower,e.upper)&&([i,s,n]=[a,e.lower,e.upper])}return i.map((a,l)=>{if(l===3)return a;let c=2/(n[l]-s[l]),u=a.map(d=>d*c);return u[3]+=(1-2*s[l])/(n[l]-s[l])-1,u})}isNear(e,r,i){let s=[1/0,1/0,1/0],n=[-1/0,-1/0,-1/0];for(let a=0;a<8;a++){let l=[0,1,2].map(c=>(a>>c&1?this.smoke.upper:this.smoke.lower)[c]-.5);for(let c=0;c<3;c++){let[u,d,m,h]=e[c],f=u*l[0]+d*l[1]+m*l[2]+h;s[c]=Math.min(s[c],f),n[c]=Math.max(n[c],f)}}return[0,1,2].every(a=>n[a]>r[a]-.5&&s[a]<i[a]-.5)}step(e,r){let{gpu:i,rule:s,work:n}=this;for(let a=0;a<e;){let l=Math.min(As,e-a),c=new Uint32Array(Ht/4*l);for(let u=0;u<l;u++){let d=ys(r,this.stepsDone+a+u),m=s.probability>=1?1:0;c.set([d,vs(s.probability),m,0],Ht/4*u)}i.write(this.steps,c),n!==null&&n.sites.cells>0&&this.submitSteps(n,l),a+=l}this.stepsDone+=e}submitSteps(e,r){let{gpu:i}=this,{places:s,told:n,batches:a}=e,l=i.compute(this.programs.step(s.layout,e.state.layout),"step"),c=Math.min(e.state.layout.each,e.sites.cells),u={0:this.uniform,3:this.filters,4:this.weights,...s.bindings(ve.first)};i.submit(d=>{for(let m=0;m<r;m++)a.forEach((h,f)=>{let p=i.bound(l,0,{...u,1:h,2:{buffer:this.steps,offset:Ht*m,size:16},5:n.buffers[f],6:e.spare.buffers[f],...e.state.bindings(ke.first)});D(d,l,[p],Math.ceil(c/256))}),[e.state,e.spare]=[e.spare,e.state]})}erase(e,r){let{work:i}=this;if(i===null||i.sites.cells===0)return;let s=this.programs.erase(i.places.layout,e.words.layout);this.eachBatch(i,this.gpu.compute(s,"erase"),i.places,n=>[{...r,3:i.state.buffers[n]},e.bindings(!1)])}get shown(){return this.work===null?0:this.work.sites.cells+this.work.sites.beside}paintedLayout(e){return W.of(this.gpu,this.shown,16*e**3)}boundFor(e,r){if(this.work===null)return 0;let{places:i,state:s}=this.work,n=Math.max(s.layout.parts+1,r);return i.layout.parts+this.paintedLayout(e).parts+n}paint(e,r){let{gpu:i,rule:s,work:n}=this;if(n===null)return;let{sites:a,places:l,state:c}=n,u=this.paintedLayout(e);if((this.painting?.layout.count!==u.count||this.painting.layout.width!==u.width)&&(this.painting?.destroy(),this.painting=j.empty(i,u,"the painting")),u.count===0)return;i.requireBindings(this.boundFor(e,0),"the painting");let d=this.programs.paint(l.layout,c.layout,u),[m,h]=[i.compute(d,"paint"),i.compute(d,"rim")],f=[a.cells,...Array($t*e+1).fill(a.beside)];f.forEach((E,_)=>{let M=new Int32Array([e,r,Math.max(_-1,0),E,s.dilation,0,0,0]);i.write(this.now[_],M)});let p={0:this.uniform,...l.bindings(ve.first)},g=this.painting.bindings(Kr.first),T=[i.bound(m,0,p),i.bound(m,1,{0:this.network}),i.bound(m,2,{0:this.now[0],...g,...c.bindings(ke.first)})];i.submit(E=>{let _=M=>Math.ceil(M*e**3/64);a.cells>0&&D(E,m,T,_(a.cells));for(let M=1;M<f.length&&a.beside>0;M++){let x=[i.bound(h,0,p),i.bound(h,1,{}),i.bound(h,2,{0:this.now[M],...g})];D(E,h,x,_(a.beside))}})}reset(){this.release(),this.work=null,this.stepsDone=0}release(){if(this.work!==null){let{places:e,state:r,spare:i,told:s,batches:n}=this.work;for(let a of[e,r,i,s,...n])a.destroy()}this.painting?.destroy(),this.painting=null}destroy(){this.release();let e=[this.uniform,this.steps,this.filters,this.weights,this.network,this.given];for(let r of[...e,this.wanted,...this.now])r.destroy()}};var Xr=`// The picture on the screen: in front of the soft background of films, as sRGB.

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
`;var pa=[.005181516702338386,.005181516702338386,.006995410187265387],qt=class t{constructor(e,r){this.gpu=e;this.format=r;this.uniform=e.uniform(32),this.sampler=e.device.createSampler({magFilter:"linear",minFilter:"linear"})}gpu;format;uniform;sampler;static async create(e,r){return await e.prepareRender(Xr,"present",r),new t(e,r)}present(e,r,[i,s],{light:n,exposure:a,wipe:l}){let{gpu:c}=this,u=c.render(Xr,"present",this.format),d=n>0?1:0,m=[...pa,d,2**a,l,i,s];c.write(this.uniform,new Float32Array(m)),c.submit(h=>{let f=h.beginRenderPass({colorAttachments:[{view:r,loadOp:"clear",storeOp:"store",clearValue:[0,0,0,1]}]});f.setPipeline(u);let p={0:this.uniform,1:e.createView(),2:this.sampler};f.setBindGroup(0,c.bound(u,0,p)),f.draw(3),f.end()})}async pixels(e,[r,i],s){let n=GPUTextureUsage.RENDER_ATTACHMENT|GPUTextureUsage.COPY_SRC,a=[r,i],l=this.gpu.device.createTexture({size:a,format:this.format,usage:n});this.present(e,l.createView(),[r,i],s);let c=new Uint8ClampedArray(await this.gpu.pixels(l,4));if(l.destroy(),this.format==="bgra8unorm")for(let u=0;u<c.length;u+=4)[c[u],c[u+2]]=[c[u+2],c[u]];return c}};var ga=4,ba=30,Ps=.5,Ls={1:3,2:2,3:2,4:2},Kt=class t{constructor(e,r,i,s,n,a){this.gpu=e;this.smoke=r;this.painting=i;this.plain=s;this.brush=n;this.screen=a;this.camera=this.framed(1)}gpu;smoke;painting;plain;brush;screen;settings={...de};camera;at=-1;layers=[];samples=0;buffers=null;stale={state:!0,look:!0};picture=null;static async create(e,r,i){Vr(e,r,1);let[s,n,a,l]=await Promise.all([at.create(e,r),at.create(e,r),Ot.create(e,r),qt.create(e,i)]);return new t(e,r,s,n,a,l)}framed(e,r=0,i=5){let[s,n]=Gr(this.smoke,this.smoke.toWorld);return ri(s,n,r,i,e,ba)}async use(e,r){let i=this.settings.half>0,s=e===null?null:await jt.create(this.gpu,e,this.smoke,i);this.layers[r]?.destroy(),s===null?this.layers.length=r:(this.layers[r]=s,this.buffers!==null&&this.begin(s)),this.stale.state=!0}get guide(){let{guide:e,guideAzimuth:r,guideElevation:i}=this.settings,[,,s]=H(r,-i);return{direction:s,amount:e}}begin(e){e.enter(this.buffers,this.guide,0),this.frameSteps(e,this.settings.warmup)}frameSteps(e,r){let i=this.settings.steps||e.rule.steps;e.step(r+i,this.settings.seed)}async show(e){this.enterFrame(await this.smoke.frame(e),e)}enterFrame(e,r){let i=this.passed(e,r);this.buffers?.destroy(),this.buffers=It.upload(this.gpu,this.smoke,e),this.at=r;for(let s of this.layers){let n=s.sites===null||s.sites.cells===0;s.enter(this.buffers,this.guide,i*this.patternSpeed(s)),this.frameSteps(s,n?this.settings.warmup:0)}this.stale.state=!0,r+1<this.smoke.length&&this.smoke.frame(r+1).catch(()=>{})}passed(e,r){if(this.buffers===null)return 0;let i=e.number-this.buffers.frame.number;return r===this.at+1||Math.abs(i)<=ga?i:0}patternSpeed({rule:e}){let{patternSpeed:r}=this.settings;return r<0?Number(e.transport):r}async restart(){for(let e of this.layers)e.reset();this.brush.brushed.clear(),await this.show(0)}step(e){for(let r of this.layers)r.step(e,this.settings.seed);this.stale.state=!0}conditionAgain(){if(this.buffers!==null)for(let e of this.layers)e.condition(this.buffers,this.guide)}lookAgain(){this.stale.look=!0}look(e=!1){let r=this.settings,[i]=this.layers;return{strength:e?0:r.strength,densityStrength:r.densityStrength,gamma:i.rule.gamma*r.density,light:{strength:r.light,azimuth:r.lightAzimuth,elevation:r.lightElevation,ambient:r.ambient},isPlain:e,mixed:r.mix}}get parts(){if(!this.layers.every(s=>s.rule.decoder.length>0))return 1;let e=this.gpu.device.limits.maxStorageBuffersPerShaderStage,r=this.brush.brushed.layout.parts+(this.buffers?.words.layout.parts??0),i=this.settings.detail;for(;i>1&&this.layers.some(s=>s.boundFor(i,r)>e);)i--;return i}prepare(){if(this.buffers===null||this.layers.length===0)return;let{parts:e}=this;if(e!==this.painting.refinement&&(this.stale.state=!0),this.stale.state){let r=this.samples||Ls[e];for(let i of this.layers)i.paint(e,Math.min(r,Ls[e]))}if((this.stale.state||this.stale.look)&&(this.painting.refine(e),this.painting.draw(this.buffers,this.layers,this.brush.brushed,this.look()),this.settings.wipe<1)){this.plain.refine(1);let[r]=this.layers;this.plain.draw(this.buffers,[r],this.brush.brushed,this.look(!0))}this.stale={state:!1,look:!1}}take(e,r){this.prepare(),(this.picture?.width!==e||this.picture.height!==r)&&(this.picture?.destroy(),this.picture=this.gpu.device.createTexture({size:[e,r],format:Nt,usage:GPUTextureUsage.RENDER_ATTACHMENT|GPUTextureUsage.TEXTURE_BINDING|GPUTextureUsage.COPY_SRC}));let i=this.picture;if(this.buffers===null||this.layers.length===0)return i;let s=Math.min(this.settings.wipe,1);return this.gpu.submit(n=>{let{camera:a}=this;this.painting.take(n,i,a,this.look(),Ps,[0,s]),s<1&&this.plain.take(n,i,a,this.look(!0),Ps,[s,1],!1)}),i}present(e,r,i,s){this.screen.present(e,r,[i,s],this.settings)}async pixels(e,r){return this.screen.pixels(this.take(e,r),[e,r],this.settings)}touch(e,r,i){if(this.buffers===null||this.layers.length===0)return;this.prepare();let{camera:s,painting:n}=this,a={camera:s,aspect:i,picture:n,gamma:this.look().gamma};this.brush.point(r,a,e,this.settings.brush),e==="erase"?(this.brush.erase(this.layers,this.buffers),this.stale.state=!0):(this.brush.blend(this.buffers),this.stale.look=!0)}};var wa=15,ya=9,Us=.3,va=250,ka=1.22,xa=.07,Sa=["guide","guideAzimuth","guideElevation"],Yt=class t extends EventTarget{constructor(r,i,s){super();this.canvas=r;this.show=i;this.smoke=s}canvas;show;smoke;gpu;stage;isPlaying=!1;isAlive=!0;speed=1;tool="orbit";names=["",""];fineness=1;took=0;context;isDirty=!0;isSettled=!1;lastChange=0;due=0;isBusy=!1;waiting=0;isClosed=!1;rules=new Map;static async open(r,i){let s=new t(r,i,await Ft.open(i.smoke));return await s.start(),new ResizeObserver(()=>s.resized()).observe(r),requestAnimationFrame(s.tick),s}async start(){this.gpu=await Ct.open();let r=navigator.gpu.getPreferredCanvasFormat(),i=this.canvas.getContext("webgpu");if(i===null)throw new L("This browser gives WebGPU no canvas.");this.context=i,i.configure({device:this.gpu.device,format:r,alphaMode:"opaque"}),this.gpu.device.addEventListener("uncapturederror",s=>{R(`The GPU complains: ${C(s.error.message)}`)}),this.stage=await Kt.create(this.gpu,this.smoke,r),this.reframe(),this.gpu.lost.then(s=>this.recover(s))}async recover(r){if(this.isClosed)return;let{settings:i,camera:s,at:n}=this.stage;R("The GPU was lost; the page begins again.");try{await this.start(),Object.assign(this.stage.settings,i),this.stage.camera=s,await this.use(this.names[0],0),this.names[1]&&await this.use(this.names[1],1),await this.goTo(Math.max(n,0)),this.dispatchEvent(new Event("recovered"))}catch(a){gt("The GPU is gone",`${C(a)} ${r.message}`)}}close(){this.isClosed=!0,this.gpu.device.destroy()}get aspect(){return(this.canvas.clientWidth||1)/(this.canvas.clientHeight||1)}resized(){this.changed()}changed(){this.isDirty=!0,this.isSettled=!1,this.lastChange=performance.now(),this.dispatchEvent(new Event("change"))}async rule(r){let i=this.rules.get(r);if(i===void 0){let s=this.show.rules.find(n=>n.name===r);if(s===void 0)throw new L(`There is no rule '${r}' here.`);i=Gt(await lt(s.model),r),this.rules.set(r,i)}return i}async use(r,i){let s=r===""?null:await this.rule(r);await this.exclusively(()=>this.stage.use(s,i)),this.names[i]=r,i===1&&r!==""&&this.stage.settings.mix===0&&this.set("mix",.5),this.changed(),this.dispatchEvent(new Event("rules"))}async add(r){let i=Gt(await r.arrayBuffer(),r.name);this.rules.set(r.name,i),this.show.rules.unshift({name:r.name,title:i.title,model:""}),await this.use(r.name,0)}async learned(r){let i=this.names[0],s=Gt(r,i);this.rules.set(i,s);let[n]=this.stage.layers;n?.learn(s)||await this.use(i,0),this.changed()}set(r,i){this.stage.settings[r]=i,Sa.includes(r)&&this.stage.conditionAgain(),r==="half"&&this.names.forEach((s,n)=>{this.use(s,n)}),this.stage.lookAgain(),this.changed()}get defaults(){return de}isDefault(r){return this.stage.settings[r]===(this.show.settings[r]??de[r])}async exclusively(r){for(this.waiting++;this.isBusy;)await new Promise(i=>setTimeout(i,5));this.waiting--,this.isBusy=!0;try{await r()}finally{this.isBusy=!1}}async goTo(r){let i=Math.min(Math.max(r,0),this.smoke.length-1);await this.exclusively(()=>this.stage.show(i)),this.changed()}async restart(){await this.exclusively(()=>this.stage.restart()),this.changed()}async play(){this.stage.at===this.smoke.length-1&&await this.restart(),this.isPlaying=!0,this.due=performance.now(),this.changed()}pause(){this.isPlaying=!1,this.changed()}look(r){r(this.stage.camera),this.changed()}reframe(){let r=this.stage.framed(this.aspect);r.distance*=ka,Jt(r,0,xa),this.stage.camera=r,this.changed()}move(r,i){this.look(s=>Jt(s,r,i))}async touch(r,i){let{tool:s}=this;if(s!=="orbit"){if(s!=="erase"&&this.stage.layers.length<2){R("Choose a second style to brush it on.");return}await this.exclusively(async()=>this.stage.touch(s,[r-.5,.5-i],this.aspect)),this.changed()}}tick=async r=>{if(!(this.isClosed||(requestAnimationFrame(s=>{this.tick(s)}),this.isBusy||this.waiting>0||document.hidden||this.stage.layers.length===0))){this.isBusy=!0;try{await this.frame(r)}catch(s){this.isPlaying=!1,R(C(s))}finally{this.isBusy=!1}}};async frame(r){let i=performance.now();this.isPlaying&&r>=this.due?await this.advance(r):this.isAlive&&!this.isPlaying&&!this.isSettled&&this.stage.at>=0&&(this.stage.step(1),this.isDirty=!0);let s=r-this.lastChange>va&&!this.isPlaying;!this.isDirty&&(this.isSettled||!s)||(this.isDirty=!1,this.draw(s?1:this.fineness),this.isSettled=s&&!this.isAlive,await this.gpu.device.queue.onSubmittedWorkDone(),s||this.adapt(performance.now()-i))}async advance(r){let i=this.stage.at+1;if(i>=this.smoke.length){this.isPlaying=!1,this.dispatchEvent(new Event("ended")),this.changed();return}let s=r-this.due,n=1e3/(this.smoke.fps*this.speed);this.due=s>n?r+n:this.due+n,await this.stage.show(i),this.isDirty=!0,this.dispatchEvent(new Event("frame"))}draw(r){let i=window.devicePixelRatio||1,s=this.gpu.device.limits.maxTextureDimension2D,n=Math.min(Math.max(Math.round(this.canvas.clientWidth*i),1),s),a=Math.min(Math.max(Math.round(this.canvas.clientHeight*i),1),s);(this.canvas.width!==n||this.canvas.height!==a)&&([this.canvas.width,this.canvas.height]=[n,a]);let l=this.stage.take(Math.max(Math.round(n*r),16),Math.max(Math.round(a*r),16));this.stage.present(l,this.context.getCurrentTexture().createView(),n,a)}adapt(r){this.took=this.took===0?r:.8*this.took+.2*r,this.took>wa?this.fineness>Us?this.fineness=Math.max(this.fineness*.92,Us):this.stage.samples=1:this.took<ya&&(this.stage.samples===1?this.stage.samples=0:this.fineness=Math.min(this.fineness*1.04,1))}};var Ea=document.getElementById("canvas");async function _a(){let t=await as();document.title=`${t.title} · vnca`;let e=await Yt.open(Ea,t);Object.assign(e.stage.settings,Ta(t.settings,e)),Object.assign(globalThis,{viewer:e}),await rr(e,location.hash),window.addEventListener("hashchange",()=>{rr(e,location.hash)}),Ma(e),document.body.classList.add("ready"),t.run?cs(e):location.hash||await e.play()}function Ta(t,e){let i=Object.keys(e.defaults).filter(s=>Number.isFinite(t[s]));return Object.fromEntries(i.map(s=>[s,tr(s,t[s])]))}function Ma(t){let e=v("span",{id:"painted"}),r=()=>{let[i,s]=t.names.map(n=>n.replaceAll("_"," "));e.textContent=s?`${i} and ${s}`:i};t.addEventListener("rules",r),r(),window.innerWidth<720&&document.body.classList.add("bare"),document.body.append(v("header",{},v("h1",{},t.smoke.name),e),Oi(t),qi(t),v("footer",{},us(t),Hi(t)),ns(t),ai()),ni(t),ji(t),document.addEventListener("dragover",i=>i.preventDefault()),document.addEventListener("drop",i=>{i.preventDefault();let s=i.dataTransfer?.files[0];s&&t.add(s).catch(n=>R(C(n)))})}_a().catch(t=>{let e=C(t),r=/WebGPU/.test(e);gt(r?"No WebGPU here":"This cannot be shown",r?`${e} ${hi}`:e)});
